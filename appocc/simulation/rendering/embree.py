"""Ray tracing by Embree in packets of sixteen rays.

The package embreex ships Embree's library, but traces single rays. Rays of neighbouring pixels take nearly the same
path through the search tree; in packets they are traced three to four times as fast. Therefore the library is called
directly; where it is not found, `build_scene` returns a scene traced by embreex.

Embree intersects packets and single rays with different instructions. The two agree up to rounding of float32, except
for rare rays along the edges of faces (some 20 in a million), which hit another face or none. Hence a dataset of the
fallback has other bytes than one traced in packets: the same seed gives the same bytes within either way of tracing.
"""

from __future__ import annotations

import ctypes
import weakref
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol

import embreex
import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from appocc.checks import BoolArray, Float32Array, IntArray
from appocc.simulation.mesh import Mesh
from appocc.simulation.rendering.compiled import array_free_kernel, inlined

# Constants from the headers of Embree 4.
_TRIANGLES, _INDEX, _VERTEX, _FLOAT3, _UINT3, _COHERENT = 0, 0, 1, 0x9003, 0x5003, 1 << 16
_PACKET = 16
_Pointer, _Int, _Size = ctypes.c_void_p, ctypes.c_int, ctypes.c_size_t
_FUNCTIONS: dict[str, tuple[Any, list[Any]]] = {
    "rtcNewDevice": (_Pointer, [ctypes.c_char_p]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [_Pointer, _Int]),
    "rtcNewScene": (_Pointer, [_Pointer]),
    "rtcNewGeometry": (_Pointer, [_Pointer, _Int]),
    "rtcSetNewGeometryBuffer": (_Pointer, [_Pointer, _Int, ctypes.c_uint, _Int, _Size, _Size]),
    "rtcCommitGeometry": (None, [_Pointer]),
    "rtcAttachGeometry": (ctypes.c_uint, [_Pointer, _Pointer]),
    "rtcReleaseGeometry": (None, [_Pointer]),
    "rtcCommitScene": (None, [_Pointer]),
    "rtcReleaseScene": (None, [_Pointer]),
    "rtcIntersect16": (None, [_Pointer] * 4),
    "rtcOccluded16": (None, [_Pointer] * 4),
}


class RayScene(Protocol):
    """Triangles that rays are traced against."""

    def nearest(
        self, origins: Float32Array, directions: Float32Array, distance_m: Float32Array
    ) -> tuple[NDArray[np.int32], Float32Array]:
        """Return face (N,) or -1, and (N, 2) barycentric weights of the first hits; updates `distance_m`."""
        ...

    def blocked(self, origins: Float32Array, directions: Float32Array) -> BoolArray:
        """Return (N,) whether rays hit anything."""
        ...


def build_scene(mesh: Mesh) -> RayScene | None:
    """Build the scene of a mesh; None if the mesh is empty."""
    if not len(mesh.faces):
        return None
    return PacketScene(mesh) if _library() else SingleRayScene(mesh)


class SingleRayScene:
    """A scene traced by embreex with single rays."""

    def __init__(self, mesh: Mesh) -> None:
        """Build the search tree."""
        self._scene: Any = rtcore_scene.EmbreeScene()
        TriangleMesh(self._scene, np.array(mesh.vertices_m), np.array(mesh.faces))

    def nearest(
        self, origins: Float32Array, directions: Float32Array, distance_m: Float32Array
    ) -> tuple[NDArray[np.int32], Float32Array]:
        """See `RayScene.nearest`."""
        # Embree overwrites the limits passed to it.
        found = self._scene.run(origins, directions, dists=distance_m.copy(), query="INTERSECT", output=1)
        met = found["primID"] >= 0
        distance_m[met] = found["tfar"][met]
        return found["primID"], np.stack([found["u"], found["v"]], axis=1)

    def blocked(self, origins: Float32Array, directions: Float32Array) -> BoolArray:
        """See `RayScene.blocked`."""
        return np.asarray(self._scene.run(origins, directions, query="OCCLUDED") == 0)


class PacketScene:
    """A scene traced through Embree's C interface in packets."""

    def __init__(self, mesh: Mesh) -> None:
        """Build the search tree."""
        found = _library()
        assert found is not None
        library, device = found
        self._scene = library.rtcNewScene(device)
        weakref.finalize(self, library.rtcReleaseScene, self._scene)
        geometry = library.rtcNewGeometry(device, _TRIANGLES)
        for slot, form, array in ((_VERTEX, _FLOAT3, mesh.vertices_m), (_INDEX, _UINT3, mesh.faces)):
            place = library.rtcSetNewGeometryBuffer(geometry, slot, 0, form, 12, len(array))
            if not place:
                raise MemoryError(f"Embree: no room for {len(array)} vertices or faces")
            ctypes.memmove(place, np.ascontiguousarray(array).ctypes.data, array.nbytes)
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(self._scene, geometry)
        library.rtcReleaseGeometry(geometry)
        library.rtcCommitScene(self._scene)
        self._intersect = _address(library.rtcIntersect16)
        self._occluded = _address(library.rtcOccluded16)

    def nearest(
        self, origins: Float32Array, directions: Float32Array, distance_m: Float32Array
    ) -> tuple[NDArray[np.int32], Float32Array]:
        """See `RayScene.nearest`."""
        face, uv, packet = np.empty(len(origins), np.int32), np.zeros((len(origins), 2), np.float32), _Packet()
        addresses = packet.addresses(self._intersect, self._scene)
        _nearest(
            addresses, packet.rays, packet.whole, packet.valid, origins, directions, distance_m, face, uv
        )  # fmt: skip
        return face, uv

    def blocked(self, origins: Float32Array, directions: Float32Array) -> BoolArray:
        """See `RayScene.blocked`."""
        blocked, packet = np.empty(len(origins), np.bool_), _Packet()
        addresses = packet.addresses(self._occluded, self._scene)
        _blocked(addresses, packet.rays, packet.valid, origins, directions, blocked)
        return blocked


@lru_cache(maxsize=1)
def _library() -> tuple[Any, int] | None:
    """Load Embree's library and create a device; None if it is missing or not of the expected version."""
    folder = Path(str(embreex.__file__)).parent
    files = [*folder.parent.glob("embreex.libs/*embree4*"), *folder.glob(".dylibs/*embree4*")]
    try:
        library = ctypes.CDLL(str(files[0]))
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError, IndexError):
        return None
    device = library.rtcNewDevice(b"threads=1")  # one process per core: each builds its scenes on its own core
    version = library.rtcGetDeviceProperty(device, 0) if device else 0
    return (library, device) if 40000 <= version < 50000 else None


def _address(function: Any) -> int:
    return int(ctypes.cast(function, _Pointer).value or 0)


def _call(typing: Any, function: Any, valid: Any, scene: Any, rays: Any, arguments: Any) -> Any:
    """Call a C function by address with four pointers, from compiled code."""
    signature = types.void(*(types.intp,) * 5)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer] * 4)
        target = builder.inttoptr(values[0], kind.as_pointer())
        builder.call(target, [builder.inttoptr(value, pointer) for value in values[1:]])
        return context.get_dummy_value()

    return signature, generate


_call_c: Any = intrinsic(_call)


class _Packet:
    """Buffers of a packet: rays with hits (22 fields of sixteen), active lanes, arguments; 64-byte aligned."""

    def __init__(self) -> None:
        self.rays, self.lanes, arguments = (_aligned(size) for size in (22 * _PACKET, _PACKET, 16))
        arguments.view(np.int32)[:2] = _COHERENT, -1  # all features
        self.whole, self.valid, self._arguments = self.rays.view(np.int32), self.lanes.view(np.int32), arguments
        # Fields of a ray: origin, nearest, direction, time, farthest, mask, number, flags.
        self.whole[9 * _PACKET : 10 * _PACKET] = -1

    def addresses(self, function: int, scene: int) -> IntArray:
        """Return (5,) addresses of the function and its arguments."""
        data = (self.lanes.ctypes.data, scene, self.rays.ctypes.data, self._arguments.ctypes.data)
        return np.array([function, *data], np.int64)


def _aligned(count: int) -> Float32Array:
    """Return (count,) float32 zeros, aligned to 64 bytes."""
    space = np.zeros(count + 16, np.float32)
    first = -space.ctypes.data % 64 // 4
    return space[first : first + count]


@inlined
def _fill(
    rays: Float32Array,
    valid: NDArray[np.int32],
    origins: Float32Array,
    directions: Float32Array,
    start: int,
    count: int,
) -> None:
    """Write origins and directions into a packet; lanes beyond `count` repeat the last ray and are inactive."""
    for lane in range(_PACKET):
        i = start + min(lane, count - 1)
        valid[lane] = -1 if lane < count else 0
        for k in range(3):
            rays[k * _PACKET + lane] = origins[i, k]
            rays[(4 + k) * _PACKET + lane] = directions[i, k]


@array_free_kernel
def _nearest(
    addresses: IntArray,
    rays: Float32Array,
    whole: NDArray[np.int32],
    valid: NDArray[np.int32],
    origins: Float32Array,
    directions: Float32Array,
    distance: Float32Array,
    face: NDArray[np.int32],
    uv: Float32Array,
) -> None:
    for start in range(0, len(origins), _PACKET):
        count = min(_PACKET, len(origins) - start)
        _fill(rays, valid, origins, directions, start, count)
        for lane in range(_PACKET):
            rays[8 * _PACKET + lane] = distance[start + min(lane, count - 1)]
            whole[18 * _PACKET + lane] = -1  # geometry that was hit
        _call_c(addresses[0], addresses[1], addresses[2], addresses[3], addresses[4])
        for lane in range(count):
            i = start + lane
            face[i] = -1
            if whole[18 * _PACKET + lane] != -1:
                distance[i], face[i] = rays[8 * _PACKET + lane], whole[17 * _PACKET + lane]
                uv[i, 0], uv[i, 1] = rays[15 * _PACKET + lane], rays[16 * _PACKET + lane]


@array_free_kernel
def _blocked(
    addresses: IntArray,
    rays: Float32Array,
    valid: NDArray[np.int32],
    origins: Float32Array,
    directions: Float32Array,
    blocked: BoolArray,
) -> None:
    for start in range(0, len(origins), _PACKET):
        count = min(_PACKET, len(origins) - start)
        _fill(rays, valid, origins, directions, start, count)
        for lane in range(_PACKET):
            rays[8 * _PACKET + lane] = 1e30
        _call_c(addresses[0], addresses[1], addresses[2], addresses[3], addresses[4])
        for lane in range(count):
            blocked[start + lane] = rays[8 * _PACKET + lane] < 0
