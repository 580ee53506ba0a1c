"""A kernel and all that it calls, optimized once as a whole.

Numba makes a library of machine code of every compiled function that a kernel calls, and of every loop that runs in
parallel, and each holds a copy of those below it, optimized anew: a chain of five calls is optimized five times. Here
what a kernel calls is only a part: its code is linked into the kernel's own and optimized there. A part can be made
*tuned*: optimized by itself before it is inlined, which some inner loops need to become vectors.

Numba offers its pipelines to be extended, but not the libraries: the names used here are its own, without a promise to
stay. Where they are missing, or with FPK_ROCKING_COMPILE_APART set, kernels are compiled as numba does it, in several
times the time.
"""

import contextlib
import os

from fpk_rocking.base.calls import BaseFunction, remembered

try:
    from llvmlite.binding import Linkage
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import Compiler
except ImportError:
    JITCodeLibrary = Compiler = object

_NEEDED = {
    JITCodeLibrary: ("_optimize_final_module", "_get_module_for_linking", "_finalize_dynamic_globals"),
    Compiler: ("_compile_core",),
}


def available():
    """Whether kernels can be compiled as a whole, and shall be."""
    known = all(hasattr(owner, name) for owner, names in _NEEDED.items() for name in names)
    return known and BaseFunction is not None and "FPK_ROCKING_COMPILE_APART" not in os.environ


class _Unbound:
    """Numba's code generator, for a library whose code is never loaded: it has no environment to be set."""

    def __init__(self, codegen):
        self._codegen = codegen

    def __getattr__(self, name):
        return getattr(self._codegen, name)

    def set_env(self, name, env):
        """Do nothing: only what is loaded has an environment."""


class Part(JITCodeLibrary):
    """Code to be linked into other code: not loaded, and optimized there."""

    tuned = False

    @property
    def codegen(self):
        """The code generator."""
        return _Unbound(self._codegen)

    def finalize(self):
        """Link in what this code calls."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        if self.tuned:
            self._optimize_final_module()
        self._finalize_dynamic_globals()
        self._finalized = True

    def _get_module_for_linking(self):
        """Return the code for what calls it, which may leave out what it has inlined."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = Linkage.linkonce_odr
        return self._final_module

    def get_pointer_to_function(self, name):  # noqa: ARG002
        """Return 0, as for a function that is not loaded."""
        self._ensure_finalized()
        return 0


class TunedPart(Part):
    """Code that is optimized by itself, too."""

    tuned = True


class Whole(Compiler):
    """Pipeline of a kernel that Python calls: whatever is compiled on the way becomes a part of it."""

    def _compile_core(self):
        state, context = self.state, self.state.targetctx
        codegen = context.codegen()
        state.library = codegen.create_library(state.func_id.func_qualname)
        state.library.enable_object_caching()
        with contextlib.ExitStack() as stack:
            stack.enter_context(_replaced(codegen, "_library_class", Part))
            stack.enter_context(_replaced(BaseFunction, "get_call_type", remembered))
            for name in ("create_cpython_wrapper", "create_cfunc_wrapper"):
                stack.enter_context(_replaced(context, name, _unless_part(getattr(context, name))))
            return super()._compile_core()


@contextlib.contextmanager
def _replaced(owner, name, value):
    """Give an attribute another value for a while."""
    own = vars(owner)
    before = own.get(name, own)
    setattr(owner, name, value)
    try:
        yield
    finally:
        if before is own:
            delattr(owner, name)
        else:
            setattr(owner, name, before)


def _unless_part(wrap):
    """Return a function that makes a wrapper for Python, but none for a part, which Python never calls."""

    def wrapped(library, *given, **named):
        return None if isinstance(library, Part) else wrap(library, *given, **named)

    return wrapped


class Tuned(Compiler):
    """Pipeline of a tuned part."""

    def _compile_core(self):
        self.state.library = TunedPart(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        return super()._compile_core()
