"""A running world in PyBullet, whose own frame is right-handed with z up."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import Watch
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.pybullet.bodies import BodyBuilder, Built, PieceBody
from agentflow.env.physics.pybullet.contacts import (
    Contacts,
    set_collisions_of_clusters,
    set_collisions_of_scene,
)
from agentflow.env.physics.pybullet.couplings import Couplings
from agentflow.env.physics.pybullet.forces import AppliedForces
from agentflow.env.physics.pybullet.grip import Grippers
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.pybullet.motors import Motors, inner_iterations, longest_series
from agentflow.env.physics.pybullet.sensing import Rows, Sensors
from agentflow.env.physics.readings import Readings, joint_motion, relative_motion
from agentflow.env.physics.rows import POSITION, ROTATION, SPIN, VELOCITY, top_speeds
from agentflow.env.physics.structure.layout import lay_out
from agentflow.env.physics.structure.spanning_tree import Piece, Skeleton
from agentflow.env.physics.world import BaseWorld, UnsplitMachine
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene, SceneObject, Start
from agentflow.machine.geometry.vectors import Vec3, add, rotate_vector


@dataclass(frozen=True)
class Bodies(UnsplitMachine):
    """The machine's bodies until the next split, and the objects that read and drive them."""

    built: Built
    sensors: Sensors
    rows: Rows
    motors: Motors


class PyBulletWorld(BaseWorld[Bodies]):
    """An `engine.World`; see there for its members."""

    def __init__(
        self, client: int, physics: Constants, assembly: Assembly, scene: Scene, rate: float
    ) -> None:
        """Clear the client and set everything up in it."""
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / rate,
            numSolverIterations=int(physics["solver_iterations"]),
            deterministicOverlappingPairs=1,
            jointFeedbackMode=pybullet.JOINT_FEEDBACK_IN_JOINT_FRAME,
            physicsClientId=client,
        )
        pybullet.setGravity(0.0, 0.0, -physics["gravity"], physicsClientId=client)
        super().__init__(physics, assembly, scene, rate)
        self.client = client
        self._builder = BodyBuilder(client, physics)
        self._ground = self._builder.ground(scene.friction)
        self.objects = {item.name: self._builder.item(item) for item in scene.objects}
        """Body number of each object."""
        moving = {item.name: self.objects[item.name] for item in scene.moving}
        fixed = [uid for name, uid in self.objects.items() if name not in moving]
        set_collisions_of_scene(client, (self._ground, *fixed), tuple(moving.values()))
        self.settle_rate = physics["settle_rate"]
        self._couplings = Couplings(client)
        self._grips: Grippers = Grippers(client, assembly.devices.grippers, moving)
        self.now = self._build_structure(self._plan(), {})
        if scene.start != Start():
            self._place_at_start(scene.start)
        self._read()

    def _advance(self, ahead: int, watch: Watch | None) -> None:  # noqa: ARG002
        now = self.now
        now.forces()
        now.motors.set_for_step()
        pybullet.stepSimulation(self.client)
        self._read()
        now.sensors.add_work(self._interval, now.motors.pushes)
        self._grips.watch()

    def _split(self, broken: Sequence[int]) -> None:
        """Rebuild the bodies that the joints were part of."""
        plan = self._plan(broken)
        old, lasting = self.now, set(plan.pieces)
        motions, parts = old.sensors.motions(), old.readings.parts(old.rows.table)
        for body in old.built.pieces:
            if body.piece not in lasting:
                pybullet.removeBody(body.uid, physicsClientId=self.client)
        present = {body.piece: body for body in old.built.pieces if body.piece in lasting}
        self.reactions[:] = 0.0
        self.now = self._build_structure(plan, present)
        for body in self.now.built.pieces:
            if body.piece not in present:
                self._restore(body, parts, motions)
        self.now.motors.set()
        self._read()

    def speeds(self, thorough: bool = True) -> tuple[float, float]:
        """Greatest linear and angular speed; unless thorough, as far as pieces' roots, objects and
        joints show: of the two parts that a joint turns, one spins at half its speed or more."""
        now = self.now
        if thorough:
            return top_speeds(now.rows.all)
        linear, angular = now.rows.head_speeds
        return linear, max(angular, 0.5 * now.sensors.spin)

    # --- internals --------------------------------------------------------------------------

    def _build_structure(self, plan: Skeleton, present: Mapping[Piece, PieceBody]) -> Bodies:
        """Build the missing bodies of `plan`, then everything that refers to bodies."""
        client, assembly = self.client, self._assembly
        pieces = tuple(
            present.get(piece) or self._builder.machine(piece, assembly.parts, assembly.joints)
            for piece in plan.pieces
        )
        layout = lay_out(assembly, plan, self._scene.moving)
        built = Built(client, assembly, plan, layout, pieces, self.objects)
        rows = Rows(built)
        set_collisions_of_clusters(built)
        self._couplings.renew(built)
        series = longest_series(assembly, plan)
        pybullet.setPhysicsEngineParameter(
            numNonContactInnerIterations=inner_iterations(series, plan), physicsClientId=client
        )
        self._grips.bind(built.handles)
        return Bodies(
            layout,
            built=built,
            readings=Readings(assembly, layout),
            contacts=Contacts(built, self._ground),
            sensors=Sensors(built),
            forces=AppliedForces(built, rows, self._laws(layout)),
            # The longest series is 1 if no motor passes torque on to another one. Where one does,
            # the solver converges slowly, and an arm would creep unless motors hold their angle.
            motors=Motors(built, self._levels, self._interval, series > 1),
            rows=rows,
        )

    def _read(self) -> None:
        """Read the rows of the heads and the reactions of all joints."""
        self.now.rows.read()
        self.now.sensors.read(self.reactions)

    def _weigh_objects(self) -> None:
        """PyBullet adapts their inertia."""
        for item in self._scene.moving:
            if item.load:
                uid = self.objects[item.name]
                pybullet.changeDynamics(uid, -1, mass=item.mass, physicsClientId=self.client)

    def _inertia(self, item: SceneObject) -> Vec3:
        x, y, z = pybullet.getDynamicsInfo(self.objects[item.name], -1, self.client)[2]
        return x, y, z

    def _change_interval(self) -> None:
        """Bullet stores the limits of motors and grips as impulses per step."""
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self._interval, physicsClientId=self.client
        )
        self.now.motors.set()
        self._grips.tighten()

    def _take_works(self) -> Array:
        return self.now.sensors.take_works()

    def _place_at_start(self, start: Start) -> None:
        """Move newly built bodies from the ground to the start of the scene."""
        rotation = start.rotation
        for uid in (body.uid for body in self.now.built.pieces):
            position, _ = pybullet.getBasePositionAndOrientation(uid, self.client)
            place = swap(add(rotate_vector(rotation, swap(position)), (0.0, start.height, 0.0)))
            turn = swap_quaternion(rotation)
            pybullet.resetBasePositionAndOrientation(uid, place, turn, self.client)

    def _restore(
        self, body: PieceBody, rows: Array, motions: Mapping[int, tuple[float, float]]
    ) -> None:
        """Give a rebuilt body the positions and velocities of its parts, whose `rows` are (P, 13).

        `motions` are position and velocity of the joints that were in trees or parallel to those,
        by joint.
        """
        client, uid, assembly = self.client, body.uid, self._assembly
        root = rows[body.piece.root].tolist()
        pybullet.resetBasePositionAndOrientation(uid, root[POSITION], root[ROTATION], client)
        pybullet.resetBaseVelocity(uid, root[VELOCITY], root[SPIN], client)
        for link, index in body.joints:
            joint = assembly.joints[link.joint]
            if link.rigid or joint.kind == "fixed":
                continue
            if joint.kind == "spherical":
                rotation, spin = relative_motion(rows[link.parent], rows[link.part])
                pybullet.resetJointStateMultiDof(uid, index, rotation, spin, physicsClientId=client)
            else:
                known = motions.get(link.joint)
                position, velocity = known or joint_motion(joint, assembly.parts, rows)
                pybullet.resetJointState(uid, index, position, velocity, physicsClientId=client)
