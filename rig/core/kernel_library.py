"""Kernels that only kernels call: kept as LLVM's intermediate code, of which the kernel that Python calls is compiled.

numba optimises and translates every function with everything that it reaches, because it links that in.  Python calls
ten of a flight's 420 kernels, and the machine code of the others never runs.  Here they end before LLVM optimises them:
it does so once, in the kernel that Python calls, with all that this reaches.  There they are declared internal, which
nearly halves the time of a trial's frame: records of arrays are passed by value, and where no one else can call a
kernel, LLVM drops the arguments that it does not use, and inlines what has one caller.
It needs insides of numba, and so is used with the versions that it was tested with; with others all kernels are
compiled as numba does.
"""

from __future__ import annotations

from typing import Any, Final

import numba
from llvmlite import binding
from numba.core.caching import CompileResultCacheImpl
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult

TESTED: Final = frozenset({(0, 68)})  # versions of numba


class InnerLibrary(JITCodeLibrary):
    """The code of one kernel that no one but another kernel calls."""

    @property
    def codegen(self) -> Any:
        """Return what makes code; there is no machine code in which it could set an address."""
        return _WithoutMachineCode(self._codegen)

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: it has no address."""
        return 0

    def serialize_using_object_code(self) -> Any:
        """Return what a cache keeps, without machine code."""
        return self.name, "bitcode", self._get_module_for_linking().as_bitcode()

    def _optimize_functions(self, ll_module: Any) -> None:
        """Tidy the functions that it defines: numba also makes a pass manager for each that it only declares."""
        ll_module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, builder)

    def _optimize_final_module(self) -> None:
        """Do nothing: LLVM optimises the kernel that Python calls, with this one in it."""

    def _finalize_final_module(self) -> None:
        """Declare it ready to be linked."""
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class InnerCompiler(Compiler):
    """numba's compiler, up to LLVM's code; for ``pipeline_class`` of numba.njit."""

    def compile_extra(self, func: Any) -> Any:
        """Compile a Python function."""
        self.state.library = InnerLibrary(self.state.targetctx.codegen(), func.__qualname__)
        return super().compile_extra(func)


class OuterLibrary(JITCodeLibrary):
    """The code of one kernel that Python calls, and of all kernels that it reaches."""

    def _optimize_final_module(self) -> None:
        """Optimise what is linked as code that no one calls from outside."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == binding.Linkage.linkonce_odr:
                function.linkage = binding.Linkage.internal
        super()._optimize_final_module()


class OuterCompiler(Compiler):
    """numba's compiler with ``OuterLibrary``; for ``pipeline_class`` of numba.njit."""

    def compile_extra(self, func: Any) -> Any:
        """Compile a Python function."""
        self.state.library = OuterLibrary(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()  # numba does so with a library that it makes itself
        return super().compile_extra(func)


def compiler(inner: bool) -> type[Compiler]:
    """Return the compiler of kernels that Python calls, or of ``inner`` ones, which only kernels call."""
    if numba.version_info.short not in TESTED:
        return Compiler
    return InnerCompiler if inner else OuterCompiler


class InnerResults(CompileResultCacheImpl):
    """The form of such kernels in a cache."""

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Return the kernel of a file."""
        made = CompileResult._rebuild(_Loading(target_context), *payload)
        return made._replace(target_context=target_context)


class _WithoutMachineCode:
    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing: numba keeps the environment's address in the machine code."""

    def unserialize_library(self, state: tuple[str, str, bytes]) -> InnerLibrary:
        """Return the library that a cache has kept."""
        name, _, bitcode = state
        library = InnerLibrary(self._codegen, name)
        library._final_module = binding.parse_bitcode(bitcode)
        library._finalize_final_module()
        return library


class _Loading:
    """A target as CompileResult asks it for the parts of a kept kernel."""

    def __init__(self, target: Any) -> None:
        self._target = target

    def __getattr__(self, name: str) -> Any:
        return getattr(self._target, name)

    def codegen(self) -> _WithoutMachineCode:
        """Return what loads a library."""
        return _WithoutMachineCode(self._target.codegen())
