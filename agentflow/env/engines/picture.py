"""Owns taking pictures with PyBullet's software renderer, which needs no display."""

from __future__ import annotations

import numpy as np

from agentflow.env.engines.base import Camera, Image
from agentflow.env.engines.bullet import pybullet
from agentflow.env.engines.frames import swap

UP = (0.0, 0.0, 1.0)
LIGHT = (-4.0, -7.0, 12.0)
"""Direction towards the light, engine frame."""
NEAR, FAR = 0.1, 400.0


def take_picture(client: int, camera: Camera) -> Image:
    """What the camera sees, (height, width, 3)."""
    view = pybullet.computeViewMatrix(
        swap(camera.eye), swap(camera.target), UP, physicsClientId=client
    )
    projection = pybullet.computeProjectionMatrixFOV(
        camera.field_of_view, camera.width / camera.height, NEAR, FAR, physicsClientId=client
    )
    _, _, pixels, _, _ = pybullet.getCameraImage(
        camera.width,
        camera.height,
        view,
        projection,
        lightDirection=LIGHT,
        shadow=1,
        renderer=pybullet.ER_TINY_RENDERER,
        flags=pybullet.ER_NO_SEGMENTATION_MASK,
        physicsClientId=client,
    )
    return np.asarray(pixels, dtype=np.uint8).reshape(camera.height, camera.width, 4)[:, :, :3]
