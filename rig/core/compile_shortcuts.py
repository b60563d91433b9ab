"""Shortcuts through numba for a process that does nothing but compile kernels: the same code in two thirds of the time.

LLVM does a quarter of the work of compiling a kernel; numba does the rest in Python, and much of it is of no use here:

- it finds the type of a call again wherever it occurs; to add two numbers it asks every addition of texts and lists;
- nine times for each kernel it works out which variables are alive, and only generators need that;
- it times every call of LLVM, once for each kernel that waits for another;
- half of its passes are for what no kernel of a flight contains: closures, comprehensions, expressions of whole arrays.

A kernel that contains it fails in such a process, and the process that needs it compiles it as numba does.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import numba
from llvmlite.binding import ffi
from numba.core import event, postproc, transforms, types
from numba.core.compiler import DefaultPassBuilder
from numba.core.types.functions import BaseFunction

from rig.core.kernel_library import TESTED, InnerCompiler, OuterCompiler

_UNUSED: Final = frozenset({  # passes
    "WithLifting",
    "InlineClosureLikes",
    "RewriteDynamicRaises",
    "MakeFunctionToJitFunction",
    "FindLiterallyCalls",
    "LiteralUnroll",
    "LiteralPropagationSubPipelinePass",
    "InlineOverloads",
    "NopythonRewrites",
    "NoPythonSupportedFeatureValidation",
    "AnnotateTypes",
    "DumpParforDiagnostics",
})  # fmt: skip
_LASTING: Final = (  # types whose values decide nothing but by the type
    types.Number,
    types.Boolean,
    types.Literal,
    types.Array,
    types.Record,
    types.BaseTuple,
    types.SliceType,
    types.NoneType,
    types.EnumMember,
    types.NumberClass,
)


def take_shortcuts() -> None:
    """Change numba in this process; do nothing with versions that this was not tested with."""
    if numba.version_info.short not in TESTED:
        return
    _skip_passes()
    _skip_liveness()
    _skip_timing()
    _keep_types_of_calls()


def _skip_passes() -> None:
    def define_pipelines(self: Any) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes[:] = [(each, text) for each, text in passes.passes if each.__name__ not in _UNUSED]
        passes.finalize()
        return [passes]

    kinds: tuple[Any, ...] = (InnerCompiler, OuterCompiler)
    for kind in kinds:
        kind.define_pipelines = define_pipelines


def _skip_liveness() -> None:
    processor: Any = postproc.PostProcessor
    full = processor.run

    def run(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        made = self.func_ir
        if made.is_generator:
            full(self, emit_dels, extend_lifetimes)
            return
        made.blocks = transforms.canonicalize_cfg(made.blocks)
        made.variable_lifetime = postproc.VariableLifetime(made.blocks)  # works itself out when it is read
        made.generator_info = None
        if emit_dels:
            self._insert_var_dels(extend_lifetimes=extend_lifetimes)

    processor.run = run


def _skip_timing() -> None:
    @contextmanager
    def no_timer(kind: str, callback: Any) -> Iterator[None]:
        yield

    events: Any = event
    events.install_timer = no_timer
    lock: Any = ffi.lib._lock
    lock._cblist.clear()


def _keep_types_of_calls() -> None:
    functions: Any = BaseFunction
    find = functions.get_call_type
    known: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws or not all(isinstance(arg, _LASTING) for arg in args):
            return find(self, context, args, kws)
        key = self, tuple(args)
        if key not in known:
            known[key] = find(self, context, args, kws)
        return known[key]

    functions.get_call_type = get_call_type
