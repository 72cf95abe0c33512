"""The contract of Dropanchor: what tags send, what the service answers, and under which keys.

`keys` and `wire` need only the standard library, so a tag can import them. The models need pydantic.
"""
