"""Types of calls, found where they were found before.

Numba types each call in a function several times. Each time it tries the templates of what is called, dozens for an
operator, until one fits the types of the arguments. Here the one that has fitted the same types before is tried first:
the result is the same, for templates know nothing of a call but its types.

The names used here are numba's own, without a promise to stay; see `base.whole`.
"""

import functools

try:
    from numba.core import errors, types
    from numba.core.target_extension import get_local_target
    from numba.core.types.functions import BaseFunction, _unlit_non_poison
    from numba.core.utils import order_by_target_specificity
except ImportError:
    BaseFunction = None
else:
    _VALUES = types.Number, types.Boolean, types.Literal, types.Array, types.BaseTuple, types.NoneType
    _search = BaseFunction.get_call_type

_fitting = {}


def remembered(function, context, args, kws):
    """Return the signature of a call, as `BaseFunction.get_call_type`; for values, not for functions as arguments."""
    if kws or not all(_is_value(type(one)) for one in args):
        return _search(function, context, args, kws)
    key = function, context, tuple(args)
    tried = _fitting[key] if key in _fitting else _in_order(function, context)
    for template, literally in tried:
        made = template(context)
        try:
            found = made.apply(args if literally else tuple(map(_unlit_non_poison, args)), kws)
        except errors.NumbaError:
            continue
        if found is not None:
            function._impl_keys[found.args] = made.get_impl_key(found)
            _fitting[key] = ((template, literally),)
            return found
    # Numba's own search says what does not fit.
    return _search(function, context, args, kws)


@functools.cache
def _is_value(kind):
    return issubclass(kind, _VALUES)


def _in_order(function, context):
    """Yield the templates of a function in numba's order, and whether literal arguments are tried as such."""
    templates = order_by_target_specificity(get_local_target(context), function.templates, fnkey=function.key[0])
    for template in templates:
        first = bool(template.prefer_literal)
        yield from ((template, first), (template, not first))
