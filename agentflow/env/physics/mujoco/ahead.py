"""Several steps at once, compiled: what `world` does in each step while nothing is switched.

Needs numba, from the extra `speed`. Without it, and for what it does not know, worlds take steps
one by one, to the same bits: that path says what a step is, and this one only repeats it.
"""

from __future__ import annotations

import ctypes
from math import isfinite, sqrt
from pathlib import Path
from typing import Any

import llvmlite.binding
import mujoco
import numba
import numpy as np
from mujoco.introspect import ast_nodes
from mujoco.introspect.structs import STRUCTS
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from agentflow.env.physics.engine import Watch
from agentflow.env.physics.laws.tension import SpringForce
from agentflow.env.physics.loads import SAFE
from agentflow.env.physics.mujoco.couplings import TIGHT
from agentflow.env.physics.mujoco.sensing import ROW_ORDER, Contacts, Found, Rows, address_of
from agentflow.env.physics.mujoco.world import Model
from agentflow.env.physics.rows import WIDTH
from agentflow.env.physics.structure.drives import HOLD, STILL
from agentflow.env.rollout import Array, Indices

MOST = 128
"""Steps that are taken at once."""
ROOM = 8192
"""Contacts for which there is room in all of them."""
UNFILTERED = np.empty((0, 6)), 0.0, np.empty((0, 6))
"""What filters no loads."""
SPRING = 5
"""Numbers of a spring: level, natural length, ramp, force, damping."""


class Ahead:
    """Takes steps ahead of a world that shows them one by one; for one model until it splits."""

    def __init__(self, now: Model, springs: SpringForce) -> None:
        """Find where everything is; `springs` are those of the world."""
        built, drag, motors = now.built, now.forces.drag, now.motors
        self._now, self._springs, self._motors = now, springs, motors
        self._model, self._data = built.model, built.data
        self.taken = self.left = self._noted = 0
        self._calm: list[int] = []
        """Steps that were taken last, how many of them were not shown, and how many were noted for
        work."""
        self._found: Found = np.empty((ROOM, 2), np.int32), np.empty(ROOM), np.empty((ROOM, 3))
        self._first = 6 * len(built.links)
        """The first number of the rows among those of the sensors."""
        general, round_ = drag.general, drag.isotropic
        own = now.forces.dragged
        self._addresses = np.array([built.model._address, built.data._address])
        self._state = (
            built.data.qpos,
            built.data.qvel,
            built.data.qacc_warmstart,
            built.data.xfrc_applied,
            built.data.sensordata,
        )
        self._drag = (
            np.array([row for row, _, _ in round_] + [row for row, _ in general], np.intp),
            np.array(own, np.intp),
            np.array([law for _, *law in round_]).reshape(-1, 2),
            np.array([law for _, law in general]).reshape(-1, 10),
        )
        ends = springs.ends
        at = now.forces.at
        self._lines = (
            np.array([(one[0], other[0]) for one, other in ends], np.intp).reshape(-1, 2),
            np.array([(*one[1], *other[1]) for one, other in ends]).reshape(-1, 6),
            np.array([(at[a], at[b]) for a, b in springs.parts], np.intp).reshape(-1, 2),
        )
        self._written = {*own, *self._lines[2].ravel().tolist()}
        self._sensors = now.reactions.source, now.reactions.share, ROW_ORDER

    def run(self, steps: int, step: float, divisions: int, watch: Watch | None) -> None:
        """Take at most so many steps of this length, s; arguments as of `engine.World.step`."""
        motors, springs, data = self._motors, self._springs, self._data
        self.note()
        steps = min(steps, MOST)
        held = np.array(list(motors.held), np.intp).reshape(-1, 4)
        angles = np.empty((steps + 1, len(motors.angles)))
        angles[0] = motors.angles
        lines = len(springs.parts)
        tuned = np.array(springs.tuned).reshape(-1, SPRING)
        pulled = np.empty((steps + 1, lines, 2))
        if lines:
            pulled[0] = springs.pulled
        self._qpos = np.empty((steps + 1, data.qpos.size))
        self._qvel = np.empty((steps + 1, data.qvel.size))
        self._warm = np.empty((steps, data.qvel.size))
        self._tables = np.empty((steps, (data.sensordata.size - self._first) // WIDTH, WIDTH))
        self._reactions: Array = np.empty((steps, *self._sensors[0].shape))
        self._counts = np.zeros(steps + 1, np.intp)
        self._torques = np.empty((steps, len(motors.row)))
        told = np.empty((3, steps))
        self._lengths = np.empty((steps, 2, lines))
        plain = watch and self._now.reactions.plain
        filtered = watch.loads.filter(divisions) if watch and plain else None
        level, keep, take = filtered or UNFILTERED
        levels, squares = np.empty((steps + 1, *level.shape)), np.empty((2, steps))
        levels[0] = level
        self._angles, self._pulled, self._step, self._began = angles, pulled, step, data.time
        taken = _run(
            steps,
            step,
            springs.half,
            self._first,
            self._addresses,
            self._state,
            self._drag,
            self._lines,
            (tuned, pulled, self._lengths),
            (motors.row, motors.changes, held, angles, self._torques),
            (self._qpos, self._qvel, self._warm, self._tables, self._reactions, told),
            (*self._found, self._counts),
            self._sensors,
            (levels, squares, keep, take),
        )
        self.taken, self.left, self._noted, self._calm = taken, taken, 0, []
        if not taken:
            return
        self._now.forces.written = self._written
        *speeds, self._air = told.tolist()
        self._speeds = list(zip(*speeds, strict=True))
        self._now.reactions.correct(self._reactions[:taken])
        if watch and filtered:
            watch.loads.foresee(self._reactions, levels[1 : taken + 1], squares[:, :taken])
            self._calm = _calm(taken, told, squares, watch.change, watch.speeds).tolist()

    @property
    def calm(self) -> int:
        """As `engine.World.calm`."""
        return self._calm[-self.left] if self.left and self._calm else 0

    def show(self, rows: Rows, contacts: Contacts) -> Array:
        """Show the next step; the reactions in it."""
        i = self.taken - self.left
        self.left -= 1
        rows.table, rows.known, rows.speeds = self._tables[i], [], self._speeds[i]
        rows.air, contacts.kept = self._air[i], (self._found, self._counts, i)
        found: Array = self._reactions[i]
        return found

    def note(self) -> None:
        """Tell motors and springs of the steps that were shown."""
        first, last = self._noted, self.taken - self.left
        if first == last:
            return
        self._noted = last
        motors, steps = self._motors, slice(first, last + 1)
        motors.angles[:] = self._angles[last].tolist()
        motors.catch_up(self._step, self._torques[first:last], self._qvel[steps], self._qpos[steps])
        if self._springs.parts:
            pulled = [(pull, before) for pull, before in self._pulled[last].tolist()]
            self._springs.catch_up(self._lengths[first:last], pulled, self._step / 2)

    def rewind(self) -> None:
        """Take back the steps that were not shown; before anything else touches the engine."""
        self.note()
        if not self.left:
            return
        data, i = self._data, self._noted
        data.qpos[:], data.qvel[:] = self._qpos[i], self._qvel[i]
        data.qacc_warmstart[:] = self._warm[i - 1]
        time = self._began
        for _ in range(i):
            time += self._step
        data.time = time
        self.left, self.taken = 0, i
        mujoco.mj_step1(self._model, data)


def can_run(now: Model) -> bool:
    """Whether nothing acts on a model that `Ahead` does not know."""
    unknown = now.calming or now.yielding or now.built.grips or now.motors.mixed
    return not unknown and all(isinstance(law, SpringForce) for law in now.forces.laws)


# --- where MuJoCo keeps what its arrays do not lead to ----------------------------------------

_PLAIN: dict[str, Any] = {
    "mjtNum": ctypes.c_double,
    "mjtSize": ctypes.c_int64,
    "mjtBool": ctypes.c_uint8,
    "mjtByte": ctypes.c_uint8,
    "float": ctypes.c_float,
    "size_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "uintptr_t": ctypes.c_void_p,
}


def _ctype(kind: Any) -> Any:
    if isinstance(kind, ast_nodes.PointerType):
        return ctypes.c_void_p
    if isinstance(kind, ast_nodes.ArrayType):
        made = _ctype(kind.inner_type)
        for extent in reversed(kind.extents):
            made *= extent
        return made
    return _struct(kind.name) if kind.name in STRUCTS else _PLAIN.get(kind.name, ctypes.c_int)


def _struct(name: str) -> Any:
    fields = [(field.name, _ctype(field.type)) for field in STRUCTS[name].fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


_DATA, _TOUCH = _struct("mjData"), _struct("mjContact")
_PROBE = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body pos="0 0 0.05">
<joint type="hinge" frictionloss="1"/><geom size="0.1"/></body></worldbody></mujoco>"""


def _agrees() -> bool:
    """Whether MuJoCo keeps its data where it says that it does."""
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    mujoco.mj_step1(model, data)
    found, contact = _DATA.from_address(data._address), data.contact
    arrays = contact.dist, data.efc_aref, data.efc_force
    told = (data.ncon, data.ne, data.nefc, *map(address_of, arrays))
    offsets = [address_of(each) - told[3] for each in (contact.pos, contact.geom)]
    return (
        told == (found.ncon, found.ne, found.nefc, found.contact, found.efc_aref, found.efc_force)
        and [_TOUCH.pos.offset, _TOUCH.geom.offset] == offsets
        and contact.dist.strides[0] == ctypes.sizeof(_TOUCH)
    )


if not _agrees():
    raise ImportError("this version of MuJoCo keeps its data elsewhere")
COUNT, EQUAL, ROWS = _DATA.ncon.offset // 4, _DATA.ne.offset // 4, _DATA.nefc.offset // 4
CONTACTS, AIMS, FORCES = (
    getattr(_DATA, name).offset // 8 for name in ("contact", "efc_aref", "efc_force")
)
SIZE = ctypes.sizeof(_TOUCH) // 4
PLACE, SHAPES, ROW = _TOUCH.pos.offset // 4, _TOUCH.geom.offset // 4, _TOUCH.efc_address.offset // 4


# --- compiled ---------------------------------------------------------------------------------

llvmlite.binding.load_library_permanently(
    str(next(Path(mujoco.__file__).parent.glob("*mujoco*.[sd][oyl]*")))
)
_one = types.ExternalFunction("mj_step1", types.void(types.intp, types.intp))
_two = types.ExternalFunction("mj_step2", types.void(types.intp, types.intp))


@intrinsic
def _pointer(_context: Any, address: Any) -> Any:
    def generate(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(address), generate


@njit(cache=True)
def _calm(taken: int, told: Array, squares: Array, change: Any, speeds: Any) -> Indices:
    """How many of the steps that were taken are calm from each one on; the first is not, as nothing
    is known of the step before."""
    calm = np.zeros(taken, np.intp)
    slowest, calmest, fastest = speeds
    for s in range(taken - 1, 0, -1):
        linear, angular, square = told[0, s], told[1, s], squares[0, s]
        if (
            abs(linear - told[0, s - 1]) <= change[0]
            and abs(angular - told[1, s - 1]) <= change[1]
            and sqrt(square) - sqrt(squares[0, s - 1]) <= change[2]
            and square <= squares[1, s] <= SAFE
            and (linear >= slowest or angular >= calmest)
            and linear <= fastest
        ):
            calm[s] = 1 + (calm[s + 1] if s + 1 < taken else 0)
    return calm


@njit
def _filter(
    reactions: Array, before: Array, keep: float, take: Array, after: Array
) -> tuple[float, float]:
    """As `Loads.update` filters a step's loads; the greatest square of a component, NaN if any is,
    and of a force or moment."""
    most = greatest = total = 0.0
    for j in range(len(before)):
        for k in range(6):
            new = reactions[j, k] * take[j, k] + before[j, k] * keep
            after[j, k] = new
            square = new * new
            if square > most or square != square:
                most = square
            total = total + square if k % 3 else square
            greatest = max(greatest, total)
        if most != most:
            break
    return most, greatest


@njit
def _turned(q: Any, a: float, b: float, c: float) -> tuple[float, float, float]:
    """`vectors.rotate_vector`; `q` is (w, x, y, z)."""
    w, x, y, z = q
    u, v, t = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u


@njit
def _moved(row: Array, offset: Array) -> Any:
    """`forces.part_motion`, of a row as MuJoCo has it."""
    q = (row[3], row[4], row[5], row[6])
    a, b, c = _turned(q, offset[0], offset[1], offset[2])
    wx, wy, wz = row[10], row[11], row[12]
    return (
        (row[0] + a, row[1] + b, row[2] + c),
        (row[7] + (wy * c - wz * b), row[8] + (wz * a - wx * c), row[9] + (wx * b - wy * a)),
    )


@njit
def _resist(own: Array, i: int, round_: Array, general: Array) -> Any:
    """Force and torque of drag on the cluster with this row, the one with law `i`."""
    if i >= round_.shape[0]:
        return _drag(own, general[i - round_.shape[0]])
    loss, spin = round_[i, 0], round_[i, 1]
    x, y, z = 0.0, 0.0, 0.0
    if spin != 0.0:
        x, y, z = -spin * own[10], -spin * own[11], -spin * own[12]
    return (-loss * own[7], -loss * own[8], -loss * own[9]), (x, y, z)


@njit
def _drag(row: Array, law: Array) -> Any:
    """`air._local_drag`, turned as `DragForce.turned` does."""
    loss, sx, sy, sz = law[0], law[1], law[2], law[3]
    mxx, myy, mzz, mxy, mxz, myz = law[4], law[5], law[6], law[7], law[8], law[9]
    w, x, y, z = row[3], row[4], row[5], row[6]
    vx, vy, vz, wx, wy, wz = row[7], row[8], row[9], row[10], row[11], row[12]
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz, xw, yw, zw = x * y, x * z, y * z, x * w, y * w, z * w
    a, b, c = 1 - 2 * (yy + zz), 2 * (xy + zw), 2 * (xz - yw)
    d, e, f = 2 * (xy - zw), 1 - 2 * (xx + zz), 2 * (yz + xw)
    g, h, i = 2 * (xz + yw), 2 * (yz - xw), 1 - 2 * (xx + yy)
    ux, uy, uz = a * vx + b * vy + c * vz, d * vx + e * vy + f * vz, g * vx + h * vy + i * vz
    px, py, pz = a * wx + b * wy + c * wz, d * wx + e * wy + f * wz, g * wx + h * wy + i * wz
    q = (w, x, y, z)
    return (
        _turned(
            q,
            py * -sz + pz * sy - loss * ux,
            pz * -sx + px * sz - loss * uy,
            px * -sy + py * sx - loss * uz,
        ),
        _turned(
            q,
            sz * uy - sy * uz - mxx * px - mxy * py - mxz * pz,
            sx * uz - sz * ux - mxy * px - myy * py - myz * pz,
            sy * ux - sx * uy - mxz * px - myz * py - mzz * pz,
        ),
    )


@njit
def _pull(
    table: Array, lines: Any, springs: Any, half: float, now: float, s: int, applied: Array
) -> None:
    """`SpringForce.__call__` in step `s`; `half` is that of the step before, `now` of this one."""
    rows, offsets, bodies = lines
    tuned, pulled, noted = springs
    for i in range(rows.shape[0]):
        level, natural, ramp = tuned[i, 0], tuned[i, 1], tuned[i, 2]
        force, damping = tuned[i, 3], tuned[i, 4]
        pull, before = pulled[s, i, 0], pulled[s, i, 1]
        pulled[s + 1, i, 0], pulled[s + 1, i, 1] = pull, before
        noted[s, 0, i] = noted[s, 1, i] = 0.0
        if level == 0.0 and pull == 0.0:
            continue
        (ax, ay, az), (ux, uy, uz) = _moved(table[rows[i, 0]], offsets[i, :3])
        (bx, by, bz), (vx, vy, vz) = _moved(table[rows[i, 1]], offsets[i, 3:])
        x, y, z = bx - ax, by - ay, bz - az
        distance = max(sqrt(x * x + y * y + z * z), 1e-9)
        per = 1.0 / distance
        x, y, z = x * per, y * per, z * per
        rate = (vx - ux) * x + (vy - uy) * y + (vz - uz) * z
        noted[s, 0, i] = pull * (before - distance + half * rate)
        pull = 0.0
        stretch = min((distance - natural) / ramp, 1.0)
        if level != 0.0 and stretch > 0.0:
            pull = level * max(force * stretch + damping * rate, 0.0)
            one, other = bodies[i, 0], bodies[i, 1]
            for k, along in enumerate((x, y, z)):
                applied[one, k] += pull * along
                applied[other, k] += -1.0 * (pull * along)
        noted[s, 1, i] = pull
        pulled[s + 1, i, 0], pulled[s + 1, i, 1] = pull, distance - now * rate


@njit(cache=True)
def _run(
    steps: int,
    step: float,
    half: float,
    first: int,
    addresses: Array,
    state: Any,
    drag: Any,
    lines: Any,
    springs: Any,
    motors: Any,
    motion: Any,
    kept: Any,
    sensors: Any,
    loads: Any,
) -> int:
    """Take steps as `MuJoCoWorld._advance` does, while there is room and nothing breaks; how many
    were taken."""
    qpos, qvel, warm, applied, sensordata = state
    dragged, bodies, round_, general = drag
    row, changes, held, angles, torques = motors
    positions, velocities, warms, tables, reactions, told = motion
    shapes, normal, places, counts = kept
    source, share, order = sensors
    levels, squares, keep, take = loads
    model, data = addresses[0], addresses[1]
    ints = numba.carray(_pointer(data), (ROWS + 1,), np.int32)
    pointers = numba.carray(_pointer(data), (FORCES + 1,), np.intp)
    table = sensordata[first:].reshape(-1, WIDTH)
    positions[0], velocities[0] = qpos, qvel
    for s in range(steps):
        rows, touching = ints[ROWS], ints[COUNT]
        met = counts[s]
        if met + touching > len(shapes):
            return s
        for i in range(lines[2].shape[0]):
            for side in range(2):
                applied[lines[2][i, side]] = 0.0
        for i in range(len(dragged)):
            force, torque = _resist(table[dragged[i]], i, round_, general)
            for k in range(3):
                applied[bodies[i], k], applied[bodies[i], 3 + k] = force[k], torque[k]
        if lines[0].shape[0]:
            _pull(table, lines, springs, half if s == 0 else step / 2, step / 2, s, applied)
        angles[s + 1] = angles[s]
        for k in range(held.shape[0]):
            i, angle = held[k, 0], qpos[held[k, 1]]
            if held[k, 3] and abs(qvel[held[k, 2]]) > STILL:
                angles[s + 1, i] = angle
            changes[i] = HOLD * (angles[s + 1, i] - angle) / (step * TIGHT)
        equalities = ints[EQUAL]
        aims = numba.carray(_pointer(pointers[AIMS]), (rows,), np.float64)
        for i in range(len(row)):
            aims[equalities + row[i]] += changes[i]
        _two(model, data)
        exerted = numba.carray(_pointer(pointers[FORCES]), (rows,), np.float64)
        for i in range(len(row)):
            torques[s, i] = exerted[equalities + row[i]]
        words = numba.carray(_pointer(pointers[CONTACTS]), (touching, SIZE), np.int32)
        reals = numba.carray(_pointer(pointers[CONTACTS]), (touching, SIZE // 2), np.float64)
        for i in range(touching):
            at, own = met + i, words[i, ROW]
            shapes[at, 0], shapes[at, 1] = words[i, SHAPES], words[i, SHAPES + 1]
            normal[at] = exerted[own] if own >= 0 else 0.0
            for k in range(3):
                places[at, k] = reals[i, PLACE // 2 + k]
        counts[s + 1] = met + touching
        _one(model, data)
        power = 0.0
        for i in range(len(dragged)):
            own, each = table[dragged[i]], 0.0
            force, torque = _resist(own, i, round_, general)
            for k in range(3):
                each += force[k] * own[7 + k]
            for k in range(3):
                each += torque[k] * own[10 + k]
            power += each
        positions[s + 1], velocities[s + 1], warms[s] = qpos, qvel, warm
        for j in range(source.shape[0]):
            for k in range(6):
                reactions[s, j, k] = sensordata[source[j, k]] * share[j, k]
        most, greatest = _filter(reactions[s], levels[s], keep, take, levels[s + 1])
        squares[0, s], squares[1, s] = most, greatest
        linear = angular = 0.0
        for r in range(table.shape[0]):
            for k in range(WIDTH):
                tables[s, r, k] = table[r, order[k]]
            a, b, c = table[r, 7], table[r, 8], table[r, 9]
            d, e, f = table[r, 10], table[r, 11], table[r, 12]
            speed, spin = a * a + b * b + c * c, d * d + e * e + f * f
            linear = linear if speed <= linear else speed
            angular = angular if spin <= angular else spin
        told[0, s], told[1, s], told[2, s] = sqrt(linear), sqrt(angular), power
        if not (isfinite(linear) and isfinite(angular) and most <= greatest < 1.0):
            return s + 1
    return steps
