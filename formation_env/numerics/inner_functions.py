# mypy: disable-error-code="no-untyped-call"
"""How numba compiles a function that only compiled code calls.

By itself numba optimises each such function and turns it into machine code, which takes a third of the time and is
thrown away: its callers take it in as numba first wrote it down, and are optimised and turned into machine code again.
"""

from typing import Any

from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import IRLegalization, NativeLowering, NoPythonBackend, NoPythonSupportedFeatureValidation


class _Library(JITCodeLibrary):
    """Code that is linked into its callers, and is no code of its own."""

    def _optimize_final_module(self) -> None:
        """Leave it to the callers."""

    def _finalize_final_module(self) -> None:
        """Make no machine code."""
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class LowerForCallers(NativeLowering):
    """numba's lowering, into a library without machine code."""

    _name = "lower_for_callers"

    def run_pass(self, state: Any) -> bool:
        """Lower the function, and tell numba of it as it does of one with machine code."""
        state.flags.no_compile = True
        state.library = library = _Library(state.targetctx.codegen(), state.func_id.func_qualname)
        super().run_pass(state)
        lowered = state["cr"]
        name = lowered.fndesc.qualname.rpartition(".")[2]
        handle = _dynfunc.make_function(lowered.fndesc.lookup_module(), name, "", 0, lowered.env, (library,))
        state.targetctx.insert_user_function(handle, lowered.fndesc, [library])
        state["cr"] = lowered._replace(cfunc=handle)
        return True


class InnerCompiler(CompilerBase):
    """numba's pipeline that ends in `LowerForCallers`. What it compiles must not be called from Python."""

    def define_pipelines(self) -> list[PassManager]:
        """The passes."""
        manager = PassManager("inner function")
        for part in (DefaultPassBuilder.define_untyped_pipeline, DefaultPassBuilder.define_typed_pipeline):
            manager.passes.extend(part(self.state).passes)
        for each in (NoPythonSupportedFeatureValidation, IRLegalization, LowerForCallers, NoPythonBackend):
            manager.add_pass(each, each.__doc__)
        manager.finalize()
        return [manager]
