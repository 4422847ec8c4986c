"""Frames of an environment, one after another, as images or in a window."""

from typing import Any, Final, cast

import matplotlib
import numpy as np
from matplotlib.backends.registry import BackendFilter, backend_registry

from formation_env.kernel.simulation import Simulation
from formation_env.rendering.modes import FRAMES_PER_S, RENDER_MODES
from formation_env.rendering.moment import Trail, read_moment
from formation_env.rendering.scene import DPI, HEIGHT_PX, WIDTH_PX, Frame, Scene
from formation_env.task.scenario import Scenario

PAUSE_S: Final = 1 / FRAMES_PER_S


class Renderer:
    """Draws a flight.

    A copy or a pickle makes a picture and a window of its own when it draws.
    """

    def __init__(self, scenario: Scenario, render_mode: str) -> None:
        """Prepare; the first `draw` does the work.

        Args:
            scenario: the scenario.
            render_mode: `rgb_array` or `human`.

        Raises:
            ValueError: another mode.
        """
        if render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode: must be one of {list(RENDER_MODES)}, got {render_mode!r}")
        self._scenario = scenario
        self._mode = render_mode
        self._scene: Scene | None = None
        self._window: Window | None = None

    def draw(self, simulation: Simulation, trail: Trail) -> Frame | None:
        """Draw the first row of a simulation, and its trail.

        Returns:
            Image (height, width, 3) in mode `rgb_array`, None in mode `human`.

        Raises:
            RuntimeError: mode `human` without a display.
        """
        if self._mode == "human" and self._window is None:
            self._window = Window()
        if self._scene is None or simulation.first_row_scenario is not self._scenario:
            self._scenario = simulation.first_row_scenario
            self._scene = Scene(self._scenario)
        frame = self._scene.draw(read_moment(simulation), trail.positions(), trail.lost())
        if self._window is None:
            return frame
        self._window.show(frame)
        return None

    def restart(self) -> None:
        """Show the whole plan again, for a new episode."""
        if self._scene is not None:
            self._scene.restart()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_scene": None, "_window": None}


class Window:
    """A pyplot window of images; once the user has closed it, it stays closed."""

    def __init__(self) -> None:
        """Open it.

        Raises:
            RuntimeError: there is no display, or matplotlib's backend has no windows.
        """
        from matplotlib import pyplot

        backend, registry = matplotlib.get_backend(), cast(Any, backend_registry)
        if backend.lower() in registry.list_builtin(BackendFilter.NON_INTERACTIVE):
            raise _no_window(f"matplotlib backend {backend!r} has none")
        if "inline" in backend.lower():  # it shows a figure once and closes it, so that later frames would be lost
            raise _no_window(f"matplotlib backend {backend!r} of the notebook shows still pictures only")
        try:
            self._figure = pyplot.figure(figsize=(WIDTH_PX / DPI, HEIGHT_PX / DPI), dpi=DPI)
        except ImportError as error:
            raise _no_window(str(error)) from error
        axes = self._figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        self._image = axes.imshow(np.full((HEIGHT_PX, WIDTH_PX, 3), 255, np.uint8))
        pyplot.show(block=False)

    def show(self, frame: Frame) -> None:
        """Show an image for a moment."""
        from matplotlib import pyplot

        if pyplot.fignum_exists(self._figure.number):
            self._image.set_data(frame)
            self._figure.canvas.draw_idle()
            self._figure.canvas.start_event_loop(PAUSE_S)

    def close(self) -> None:
        """Close it."""
        from matplotlib import pyplot

        pyplot.close(self._figure)


def _no_window(reason: str) -> RuntimeError:
    return RuntimeError(f"render_mode: 'human' needs a display and a GUI toolkit: {reason}; use 'rgb_array'")
