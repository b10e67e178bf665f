"""Imported where a second of computing shall have many shards, by processes that tests start, too."""

from warpimpact.campaign import parts

SIZE = 256
parts.FEWEST = SIZE
