"""Routers whose operations have the names of their functions."""

from typing import Any

from fastapi import APIRouter


class Router(APIRouter):
    """An `APIRouter` with the name of the function as the id of each operation, unless a route says another one."""

    def __init__(self, **options: Any) -> None:
        super().__init__(generate_unique_id_function=lambda route: route.name, **options)
