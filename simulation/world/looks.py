"""What the world looks like in pictures; nothing here touches anything."""

from __future__ import annotations

from typing import Any, Final

import mujoco

BODY_RGBA: Final = (0.86, 0.68, 0.55, 1.0)
CLOTHES_RGBA: Final = (0.25, 0.42, 0.62, 1.0)
TROUSERS_RGBA: Final = (0.28, 0.30, 0.36, 1.0)
FLOOR: Final = "floor"


def dress(spec: Any) -> None:
    """Give floor, sky, light and clothes to a world whose geometries are all there."""
    spec.visual.headlight.ambient = [0.55, 0.55, 0.55]
    spec.visual.headlight.diffuse = [0.35, 0.35, 0.35]
    spec.visual.headlight.specular = [0.05, 0.05, 0.05]
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.93, 0.95, 0.97], rgb2=[0.80, 0.85, 0.90], width=64, height=384,
    )  # fmt: skip
    spec.add_texture(
        name=FLOOR, type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.90, 0.90, 0.88], rgb2=[0.82, 0.82, 0.80], width=256, height=256,
    )  # fmt: skip
    material = spec.add_material(name=FLOOR, texrepeat=[80, 80], reflectance=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = FLOOR
    for geom in spec.geoms:
        if geom.name == FLOOR:
            geom.material = FLOOR
        elif "thigh" in geom.name or "shank" in geom.name or geom.name == "pelvis":
            geom.rgba = list(TROUSERS_RGBA)
        elif geom.name == "torso" or "upper_arm" in geom.name:
            geom.rgba = list(CLOTHES_RGBA)
        elif geom.name == "head" or "forearm" in geom.name:
            geom.rgba = list(BODY_RGBA)
        elif "sole" in geom.name:
            geom.rgba = [0.1, 0.1, 0.1, 1.0]
