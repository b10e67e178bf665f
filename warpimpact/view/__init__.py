"""What a person sees of a result, as data; its text and its HTML, and drawings to scale as SVG.

Change how tables and drawings look here; what stands in them belongs in the room of the result. It imports no
other room.
"""
