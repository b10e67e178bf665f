"""The constants of the continuum, of its scheme and of its erosion (docs/continuum.md), as in kernels/constants.py."""

from ..constants import Constant

# The element (hexahedra.py)
QUADRATIC = Constant(
    1.2,
    "density × (length × rate of compression)²",
    "Bulk viscosity of von Neumann and Richtmyer: a shock is some elements wide.",
    test="verification/test_continuum.py::test_a_compression_meets_its_viscosity",
)
LINEAR = Constant(
    0.06,
    "density × speed of sound × length × rate of compression",
    "Bulk viscosity that damps what rings behind a shock.",
    test="verification/test_continuum.py::test_a_compression_meets_its_viscosity",
)
HOURGLASS = Constant(
    0.02,
    "density × speed of sound × area",
    "Viscous resistance against hourglasses: 0.05 takes half as much energy again, and is farther from what finer "
    "meshes give.",
    test="verification/test_continuum.py::test_an_hourglass_is_braked_at_the_rate_of_its_resistance",
)
SECOND_HOURGLASS = Constant(
    0.5,
    "HOURGLASS",
    "Resistance of a hit that is marched again because its hourglasses took too much energy. They take less then, 0.10 "
    "in the place of 0.13. In every hit it would lower the limit velocity of 20 mm of AA6082-T6 by 4.4 %, not 2.7 %.",
    test="warpimpact/continuum/test_hits.py::test_a_hit_with_large_hourglasses_is_computed_again_with_less_resistance",
)
DEFORMING_HOURGLASS = Constant(
    0.5,
    "HOURGLASS",
    "Resistance of all bodies of a hit whose core deforms, which has more of them. With 1 most hits of hard steel were "
    "marched twice, and 5 of 14 failed at 6.9 mm of HHA. Energies of five hits differ by 2.3 % and less.",
)
CORE_HOURGLASS = Constant(
    2.0,
    "HOURGLASS",
    "Resistance of a core of elements, whose tip flows under loads of single nodes: with 1 hourglasses take more in "
    "thick plates, where nodes of coarse elements press; with 4 they take more of what a bare core loses at an edge.",
    test="verification/test_deformable_core.py::test_a_core_that_yields_goes_straight_through_the_middle_of_a_web",
)
YIELD_SPEED = Constant(
    40.0,
    "m/s",
    "Speed at which a material yields, its yield stress over density and speed of sound. That of armour steel is as "
    "high; in a softer material the resistance is less by the root of the share: more takes too much of the energy, "
    "and less lets hourglasses grow until they take it.",
    test="verification/test_continuum.py::test_an_hourglass_is_braked_at_the_rate_of_its_resistance",
)
THINNEST = Constant(
    0.2,
    "length at rest",
    "An element that is thinner fails: its step would hold up all others.",
    test="verification/test_continuum.py::test_an_element_fails_where_it_is_too_thin_or_too_wide",
)
SHORTEST = Constant(
    0.15,
    "size of a fine element",
    "An element that is thinner fails, too: slivers at the edges of holes would hold up all others.",
    test="verification/test_continuum.py::test_an_element_fails_where_it_is_too_thin_or_too_wide",
)
WIDEST = Constant(
    4.0,
    "volume at rest",
    "An element that is larger fails: no metal is.",
    test="verification/test_continuum.py::test_an_element_fails_where_it_is_too_thin_or_too_wide",
)
FOLDED = Constant(
    -0.2,
    "volume at rest",
    "An element of a light metal fails where the Jacobian at a corner is less: inside out it is no metal. The "
    "resistance against hourglasses holds it then, and took 10 J of the 37 J of a hit that it spoilt.",
    test="verification/test_continuum.py::test_an_element_of_a_light_metal_fails_where_it_folds",
)
FOLDED_STRAIN = Constant(
    0.05, "1", "Plastic strain below which no element counts as folded: some at the edges of holes are concave at rest."
)
FOLDED_CORE_STRAIN = Constant(
    1.0,
    "1",
    "The same in a core, whose tip flows in the plate, and whose mesh has corners that are nearly flat. With 4, "
    "folded elements took 3 % of the energy of a hit on standard elements; without the rule, more than the core lost.",
)
LIGHT = Constant(
    5000.0,
    "kg/m³",
    "Density of the heaviest metal whose folded elements fail. In steel they take less of the energy.",
    test="verification/test_continuum.py::test_an_element_of_a_light_metal_fails_where_it_folds",
)
LEAST_VOLUME = Constant(1.0e-3, "volume at rest", "Below, the density of an element that has failed grows no more.")
LEAST_DIVISOR = Constant(1.0e-30, "m³ or m⁴", "Keeps a division by the volume or the faces of no element finite.")

# The flow (hexahedra.py)
LEAST_STRAIN = Constant(
    1.0e-6, "1", "Plastic strain below which a power law has the slope of here: it is infinite at 0."
)
LEAST_HEAT = Constant(
    1.0e-6, "range to melting", "Heat below which it counts as this in its power, whose logarithm is taken."
)
LEAST_DEVIATOR = Constant(1.0e-20, "Pa²", "Keeps the angle of a stress without a deviator finite.")

# The contact (stages.py)
DAMPING = Constant(
    0.1,
    "critical damping",
    "Of a node on its penalty spring. More drags on nodes that leave.",
    test="verification/test_continuum.py::test_a_contact_damps_a_tenth_of_what_is_critical",
)
SLIP = Constant(5.0, "m/s", "Sliding speed below which friction sets in gradually, so that it does not chatter.")
ON_AXIS = Constant(1.0e-12, "m", "Keeps the normal at a point on the core's axis finite.")
OUTSIDE = Constant(1.0e3, "m", "Farther away than any core, where a search for its ends begins.")

# The contact between bodies (contact.py)
STABLE_CONTACT = Constant(
    0.2,
    "reduced mass / step²",
    "Stiffest spring between a node and a face: a corner may hold five nodes at a time.",
    test="verification/test_continuum_contact.py::test_bars_that_meet_exchange_their_velocities",
)
DEEPEST = Constant(
    0.7, "size of a fine element", "Farthest behind a face that a node touches it: beyond, it is behind another face."
)
AT_FACE = Constant(
    0.02,
    "reach of the contact",
    "A node so far in front of a face or beside it is at it: there is no gap to the next one.",
)

# The march (stages.py)
COURANT = Constant(
    0.6,
    "shortest time of a wave across an element",
    "Length of a step. Hourglasses and contact take what is left to 1.",
    test="verification/test_continuum.py::test_a_bar_swings_with_the_speed_of_sound",
)
GROWTH = Constant(1.05, "step before", "The longest that a step may be: the scheme is of second order at even steps.")
FREE_WAY = Constant(
    3.0e-3,
    "m",
    "A core this far behind the target or in front of it is free, and a layer this far from the core is not marched.",
)
FREE_TIME = Constant(2.0e-6, "s", "A core is free this long after its last touch.")
WINDOW = Constant(
    1.0e-6,
    "s",
    "Over which the loads that bend a core are averaged: nodes come and go within some steps of 10 ns, and the first "
    "bending mode of a core takes some 30 µs.",
    test="kernels/test_bending.py::test_impulses_on_a_rod_bend_it_as_in_the_closed_form",
)
UNBOUNDED = Constant(2.0, "impact energy", "A core that has more is no core any more: its motion has blown up.")
