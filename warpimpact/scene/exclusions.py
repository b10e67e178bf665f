"""Options that exclude or need each other: rows that give the messages and a page of the documentation."""

from collections.abc import Mapping

LAYERS, STOP = "[[layer]]", "[stop]"
IRREDUCIBLE = "hits.irreducible = true"
NODAL = 'numerics.scheme = "nodal"'
BLOCK = 'numerics.layout = "block"'
DOUBLE = 'numerics.precision = "double"'
BENDING = "output.bending = true"
STRENGTH = "core.strength"
BY_PATH = "plate.degradation_distance"
MASS_PROPERTIES = "core.centre_of_mass, core.inertia_axial or core.inertia_transverse"
TURNED = "a distribution of impact.obliquity, azimuth, pitch, yaw or spin"
HOLED_LAYERS = "a [[layer]] with a pattern or a rim"
UNEVEN = 'hits.sampling = "grid" or "list"'
ONE_SCRAMBLING = "hits.replicates = 1"
LISTED_STRENGTH = "a column strength in hits.file"
WHOLE_PLATE, SIZE = 'hits.area = "plate"', "size of the plate"
BY_TIME, STAGGERED, HOLES = "plate.degradation_interval", "staggered", "holes"
THICKNESS, AREAL_DENSITY = "thickness", "areal_density"
FREE_SURFACE = "interaction.free_surface"
LIMIT_COMMAND = "warpimpact limit"


_BY_BLOCK = "a block computes the consistent scheme in single precision, without the bending moment"
EXCLUDED: tuple[tuple[str, str, str], ...] = (
    (LIMIT_COMMAND, STOP, "limits are searched for every hit; leave out the table [stop]"),
    (BY_TIME, BY_PATH, "exposure counts either time or path"),
    (THICKNESS, AREAL_DENSITY, "with the holes each gives the other"),
    (STAGGERED, HOLES, "it stands for two holes; list all holes of the cell"),
    (LAYERS, NODAL, "the nodal scheme knows one plate and no layers behind it"),
    (BY_PATH, NODAL, "the nodal scheme weakens the plate once per time step"),
    (BENDING, NODAL, "the nodal scheme has no bending moment"),
    (FREE_SURFACE, NODAL, "the nodal scheme has the same stress everywhere"),
    (BENDING, MASS_PROPERTIES, "it needs the mass of every slice, which follows from the shape alone"),
    *((BLOCK, other, _BY_BLOCK) for other in (NODAL, DOUBLE, BENDING)),
    (IRREDUCIBLE, TURNED, "a symmetry holds for every shot; of the impact, only velocity may scatter"),
    (IRREDUCIBLE, HOLED_LAYERS, "only layers that are solid and unbounded leave the symmetry of the plate"),
    (STOP, UNEVEN, 'an interval needs "sobol" or "random"'),
    (STOP, ONE_SCRAMBLING, 'an interval of "sobol" needs several scramblings'),
)
_BREAKS = 'a core breaks by its bending stress; or give continuum.core = "deformable", by whose stress it breaks'
NEEDS: tuple[tuple[str, str, str], ...] = (
    (LISTED_STRENGTH, BENDING, _BREAKS),
    (STRENGTH, BENDING, _BREAKS),
    (WHOLE_PLATE, SIZE, "only a finite plate can be covered"),
)


def check_together(given: Mapping[str, str | bool]) -> None:
    """Refuse options that cannot be combined. `given` has whether each option is in use, or the text that names it in
    the message. Options without an entry are not checked.

    Raises:
        ValueError: the message names both options and the reason.
    """
    used = {option: option if name is True else name for option, name in given.items() if name}
    for option, other, why in EXCLUDED:
        if option in used and other in used:
            raise ValueError(f"{used[option]} cannot be combined with {used[other]}: {why}")
    for option, other, why in NEEDS:
        if option in used and other in given and other not in used:
            raise ValueError(f"{used[option]} needs {other}: {why}")
