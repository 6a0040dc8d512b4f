"""Owns contacts: which blocks and things touch which, in PyBullet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.env.physics.layout import Built, Handle
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.spanning_tree import Skeleton
from agentflow.env.tasks.base import Body

TOUCH = 0.005
"""Surfaces no further apart than this touch, m."""
STANDING_GROUP = 2
LOOSE_GROUP = 1
"""Clusters of one part need no group of their own."""
FIRST_BIT, LAST_BIT = 2, 30
"""Group bits of rigid clusters with several parts; the 29th and later ones share the last."""


class Contacts:
    """Names the bodies of one world."""

    def __init__(
        self,
        client: int,
        assembly: Assembly,
        built: Sequence[Built],
        ground: int,
        things: Mapping[str, int],
    ) -> None:
        self._client = client
        self._who: dict[Handle, Body] = {(ground, -1): "ground"}
        self._who |= {(uid, -1): name for name, uid in things.items()}
        for body in built:
            for part, index in body.index.items():
                self._who[body.uid, index] = assembly.parts[part].block
        self._where: dict[Body, list[Handle]] = {}
        for handle, named in self._who.items():
            self._where.setdefault(named, []).append(handle)

    def touching(self, body: Body) -> frozenset[Body]:
        """What a block or thing is in contact with in this step.

        What comes fast bounces off before PyBullet has seen it closer than `TOUCH`; then only the
        force tells of the contact.
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


def set_collisions_of_clusters(client: int, plan: Skeleton, built: Sequence[Built]) -> None:
    """Keep the parts of a rigid cluster from colliding with each other, and nothing else."""
    sizes: dict[int, int] = {}
    for cluster in plan.cluster:
        sizes[cluster] = sizes.get(cluster, 0) + 1
    several = [cluster for cluster, size in sizes.items() if size > 1]
    bits = {cluster: 1 << min(FIRST_BIT + i, LAST_BIT) for i, cluster in enumerate(several)}
    for body in built:
        for part, index in body.index.items():
            bit = bits.get(plan.cluster[part], LOOSE_GROUP)
            mask = -1 if bit == LOOSE_GROUP else ~bit
            pybullet.setCollisionFilterGroupMask(body.uid, index, bit, mask, physicsClientId=client)


def set_collisions_of_scene(client: int, fixed: Sequence[int], moving: Sequence[int]) -> None:
    """Let what never moves collide with all that moves, and things that move with everything.

    Fixed bodies that touch each other would cost a contact test each in every step.
    """
    for uid in fixed:
        pybullet.setCollisionFilterGroupMask(
            uid, -1, STANDING_GROUP, ~STANDING_GROUP, physicsClientId=client
        )
    for uid in moving:
        pybullet.setCollisionFilterGroupMask(uid, -1, LOOSE_GROUP, -1, physicsClientId=client)
