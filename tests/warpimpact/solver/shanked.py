"""A shanked core at a perforated plate, alone and before a base that stops some of the cores."""

from warpimpact.scene import (
    CirclePattern,
    Hits,
    Impact,
    Layer,
    OgiveCore,
    Plate,
    Record,
    Scene,
    Target,
    make_shots,
)

CORE = OgiveCore(diameter=6.17e-3, crh=3, length=27e-3, mass=5.25e-3)
PLATE = Plate(
    thickness=6e-3,
    resistance=2e9,
    shear_coefficient=0.08,
    degradation=0.85,
    pattern=CirclePattern(diameter=7e-3, spacing=(10e-3, 17.3e-3), staggered=True),
)
SCENE = Scene(core=CORE, target=PLATE, record=Record(standoffs=(0.05, 0.13)))
IMPACT = Impact(velocity="820 m/s", obliquity="12 deg", yaw="1 deg")
PILOT = make_shots(IMPACT, Hits(count=32, seed=5), PLATE)
OTHERS = make_shots(IMPACT, Hits(count=96, seed=6), PLATE)
# Stops some of the cores, and lets others go on slowly.
BASE = Layer(thickness=6.6e-3, resistance=5e9, gap=40e-3, shear_coefficient=0.08)
STOPPING = SCENE.model_copy(update={"target": Target(layers=(PLATE, BASE))})
