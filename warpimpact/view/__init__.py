"""What a person sees of a result, as data; and the text and the HTML of it.

Change how tables look here; what stands in them belongs in the room of the result. It imports no other room.
"""
