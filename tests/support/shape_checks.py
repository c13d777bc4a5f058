"""Types and shapes of signatures, checked in every call at a fraction of what jaxtyping's own decorator takes.

The import hook of jaxtyping (``--jaxtyping-packages``) decorates every function and dataclass of the packages that it is
given. Its decorator binds the arguments to the signature in Python and checks them twice, before the call and again with
what is returned: a third of the time of motions in short steps. Here beartype checks each argument and what is returned
once; a context of jaxtyping, in which the sizes of one call are compared with each other, is opened only for signatures
that name sizes. Shapes in numbers, as of vectors in space, are compared without jaxtyping.
"""

import dataclasses
import functools
import inspect
import types
import typing
from collections.abc import Callable

import jaxtyping
import numpy as np
from beartype import beartype

SIZES_OF_ONE_CALL = jaxtyping.jaxtyped("context")  # holds nothing itself: the sizes are on a stack of the thread


def install():
    """Let modules that are imported from now on be decorated by :func:`checked`."""
    setattr(jaxtyping, "jaxtyped", lambda *, typechecker: checked)  # noqa: B010  # the hook asks for it by this name


def checked(made):
    """The same function or dataclass, its signature checked in every call."""
    if isinstance(made, classmethod | staticmethod):
        return type(made)(checked(made.__func__))
    if isinstance(made, property):
        return property(*(part and checked(part) for part in (made.fget, made.fset, made.fdel)))
    if not inspect.isclass(made):
        return _checked_function(made)
    if dataclasses.is_dataclass(made) and not hasattr(made.__init__, "__wrapped__"):  # else it is inherited, and checked
        setattr(made, "__init__", _checked_function(made.__init__))  # noqa: B010
    return made


def _checked_function(made: Callable) -> Callable:
    hints = {name: _in_numbers(hint) for name, hint in _hints(made).items()}
    alike = types.FunctionType(made.__code__, made.__globals__, made.__name__, made.__defaults__, made.__closure__)
    alike.__kwdefaults__, alike.__annotations__, alike.__qualname__ = made.__kwdefaults__, hints, made.__qualname__
    alike.__module__ = made.__module__
    bare = beartype(alike)
    if bare is alike:  # nothing to check
        return made
    if not any(map(_names_sizes, hints.values())):
        return functools.update_wrapper(bare, made)

    @functools.wraps(made)
    def call(*args, **named):
        with SIZES_OF_ONE_CALL:
            return bare(*args, **named)

    return call


def _hints(made: Callable) -> dict:
    """Annotations without those that name what is imported for type checkers only."""
    found: dict = {}
    for name, hint in made.__annotations__.items():
        holder = types.SimpleNamespace(__annotations__={name: hint})
        try:
            found |= typing.get_type_hints(holder, made.__globals__, include_extras=True)
        except (NameError, TypeError):
            continue
    return found


def _names_sizes(hint) -> bool:
    return _is_shape(hint) or any(map(_names_sizes, typing.get_args(hint)))


def _is_shape(hint) -> bool:
    return inspect.isclass(hint) and issubclass(hint, jaxtyping.AbstractArray)


class _ShapeInNumbers(type):
    """Class of the arrays of one shape."""

    shape: tuple[int, ...]

    def __instancecheck__(cls, array) -> bool:
        return isinstance(array, np.ndarray) and array.shape == cls.shape


@functools.cache
def _of_shape(*shape: int) -> type:
    return _ShapeInNumbers(f"array of shape {shape}", (), {"shape": shape})


def _in_numbers(hint):
    """A shape without names, or one of a union, as a class that compares numbers; any other hint itself."""
    if isinstance(hint, types.UnionType) or typing.get_origin(hint) is typing.Union:
        return typing.Union[tuple(map(_in_numbers, typing.get_args(hint)))]  # noqa: UP007  # of any number of hints
    if _is_shape(hint) and (hint.array_type, hint.dtype) == (np.ndarray, jaxtyping.Shaped):
        sizes = hint.dim_str.split()
        if all(map(str.isdecimal, sizes)):
            return _of_shape(*map(int, sizes))
    return hint
