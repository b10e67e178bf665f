"""Data: threats and materials by name, each with its sources and its assumptions.

Change what an entry says, or add a file of an entry, in threats/ and materials/; how a campaign takes a name is in
campaign. It imports scene.
"""

from warpimpact.catalogue.by_name import layer, material, plate, threat

__all__ = ["layer", "material", "plate", "threat"]
