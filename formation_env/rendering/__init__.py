"""Pictures of a flight. The only package of formation_env that imports matplotlib; it is imported when first needed."""

from formation_env.rendering.renderer import Renderer
from formation_env.rendering.snapshot import save_frame

__all__ = ["Renderer", "save_frame"]
