"""Contacts in PyBullet: which blocks and objects touch, and which may collide."""

from collections import Counter
from collections.abc import Sequence
from functools import partial

from agentflow.env.physics.engine import Touch
from agentflow.env.physics.pybullet.bodies import Built, Handle
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.world import Pair, pair_up, sum_touches
from agentflow.env.scene import Body

TOUCH = 0.005
"""Surfaces at most this far apart touch, m."""
STANDING_GROUP = 2
LOOSE_GROUP = 1
"""Clusters of one part share a group."""
FIRST_BIT, LAST_BIT = 2, 30
"""Group bits of rigid clusters with several parts; the 29th and later ones share the last."""


class Contacts:
    """What touches what in one world."""

    def __init__(self, built: Built, ground: int) -> None:
        self._client, parts = built.client, built.assembly.parts
        self._who: dict[Handle, Body] = {(ground, -1): "ground"}
        self._who |= {(uid, -1): name for name, uid in built.objects.items()}
        self._who |= {handle: parts[part].block for part, handle in built.handles.items()}
        self._where: dict[Body, list[Handle]] = {}
        for handle, named in self._who.items():
            self._where.setdefault(named, []).append(handle)
        self._pairs: dict[tuple[int, int, int, int], Pair | None] = {}
        """Bodies in contact by body and link numbers; None if they are one."""

    def touching(self, body: Body) -> frozenset[Body]:
        """What a block or object was in contact with in the last step.

        Something fast may bounce off before PyBullet sees it closer than `TOUCH`; then only the
        contact force shows the contact.
        """
        found = {
            self._who[contact[2], contact[4]]
            for uid, index in self._where[body]
            for contact in pybullet.getContactPoints(
                bodyA=uid, linkIndexA=index, physicsClientId=self._client
            )
            if contact[8] <= TOUCH or contact[9] > 0.0
        }
        return frozenset(found - {body})

    def all(self) -> list[Touch]:
        """Everything that was in contact in the last step."""
        return sum_touches(
            (self._pair(point[1:5]), point[9], point[5])
            for point in pybullet.getContactPoints(physicsClientId=self._client)
            if point[9] > 0.0 or not point[8] > TOUCH
        )

    def _pair(self, key: tuple[int, int, int, int]) -> Pair | None:
        """The bodies with these body and link numbers."""
        if key not in self._pairs:
            self._pairs[key] = pair_up(self._who[key[0], key[2]], self._who[key[1], key[3]])
        return self._pairs[key]


def set_collisions_of_clusters(built: Built) -> None:
    """Switch off collisions between the parts of each rigid cluster."""
    client, names = built.client, built.plan.cluster
    several = [cluster for cluster, size in Counter(names).items() if size > 1]
    bits = {cluster: 1 << min(FIRST_BIT + i, LAST_BIT) for i, cluster in enumerate(several)}
    for part, (uid, index) in built.handles.items():
        bit = bits.get(names[part], LOOSE_GROUP)
        mask = -1 if bit == LOOSE_GROUP else ~bit
        pybullet.setCollisionFilterGroupMask(uid, index, bit, mask, physicsClientId=client)


def set_collisions_of_scene(client: int, fixed: Sequence[int], moving: Sequence[int]) -> None:
    """Let fixed bodies collide with everything that moves, and moving objects with everything.

    Fixed bodies that touched each other would cost a contact test in every step.
    """
    set_group = partial(pybullet.setCollisionFilterGroupMask, physicsClientId=client)
    for uid in fixed:
        set_group(uid, -1, STANDING_GROUP, ~STANDING_GROUP)
    for uid in moving:
        set_group(uid, -1, LOOSE_GROUP, -1)
