// Draws each figure when it comes near the window: thirty at once would block the page for seconds.
(() => {
  const config = CONFIG;
  const waiting = [];
  let busy = false;
  const draw = (element) => {
    const source = element.querySelector('script[type="application/json"]');
    if (!source) return;
    const figure = JSON.parse(source.textContent);
    source.remove();
    Plotly.newPlot(element, figure.data, figure.layout, config);
  };
  const next = () => {
    const element = waiting.shift();
    busy = element !== undefined;
    if (!busy) return;
    draw(element);
    setTimeout(next, 0);
  };
  const enqueue = (element) => { waiting.push(element); if (!busy) { busy = true; setTimeout(next, 0); } };
  const plots = [...document.querySelectorAll(".plot")];
  const drawAll = () => plots.forEach(draw);
  window.addEventListener("beforeprint", drawAll);
  if (!("IntersectionObserver" in window)) { drawAll(); return; }
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (entry.isIntersecting) { observer.unobserve(entry.target); enqueue(entry.target); }
    }
  }, { rootMargin: "300px" });
  plots.forEach((plot) => observer.observe(plot));
})();
