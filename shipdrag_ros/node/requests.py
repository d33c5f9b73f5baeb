# SPDX-License-Identifier: Apache-2.0
"""
Requests that are too long, known before they are unpacked.

rclpy makes Python objects of a whole request before anybody can look at it: of
300 000 parameters for half a minute, in which nothing else runs. The message lies in
memory by then, with its number of entries at its beginning; one that has too many is
not unpacked.
"""

from __future__ import annotations

import ctypes
from types import SimpleNamespace
from typing import Any

from rclpy.service import Service

LONGEST = 1000  # names or parameters of a request
# whose requests begin with a sequence
COUNTED = frozenset(
    {
        'DescribeParameters',
        'GetParameters',
        'GetParameterTypes',
        'ListParameters',
        'SetParameters',
        'SetParametersAtomically',
    }
)
_Convert = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
_api = ctypes.pythonapi
_api.PyCapsule_GetPointer.restype = ctypes.c_void_p
_api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
_api.PyCapsule_New.restype = ctypes.py_object
_api.PyCapsule_New.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]


class TooLong:
    """Stands for a request that was not unpacked."""


class _Sequence(ctypes.Structure):
    """How C holds a sequence."""

    _fields_ = (
        ('data', ctypes.c_void_p),
        ('size', ctypes.c_size_t),
        ('capacity', ctypes.c_size_t),
    )


def unpack_no_giants(service: Service) -> None:
    """
    Let a service be called with `TooLong` instead of a request of more than `LONGEST` entries.

    Parameters
    ----------
    service
        Of one of the kinds in `COUNTED`; others stay as they are.
    """
    kind: Any = service.srv_type
    support: Any = type(kind.Request)
    if kind.__name__ not in COUNTED or support._CONVERT_TO_PY is None:
        return
    unpack = _Convert(_api.PyCapsule_GetPointer(support._CONVERT_TO_PY, None))

    def convert(message: int) -> Any:
        few = _Sequence.from_address(message).size <= LONGEST
        return unpack(message) if few else TooLong()

    called = _Convert(convert)

    class Counted(type):
        """The type of a request, as rclpy looks for what to do with it."""

        _CREATE_ROS_MESSAGE = support._CREATE_ROS_MESSAGE
        _CONVERT_FROM_PY = support._CONVERT_FROM_PY
        _CONVERT_TO_PY = _api.PyCapsule_New(ctypes.cast(called, ctypes.c_void_p), None, None)
        _TYPE_SUPPORT = support._TYPE_SUPPORT
        _DESTROY_ROS_MESSAGE = support._DESTROY_ROS_MESSAGE
        keeps = called  # as long as it can be called

    request = Counted('Request', (), {})
    service.srv_type = SimpleNamespace(Request=request, Response=kind.Response)
