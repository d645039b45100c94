"""Give out the file of a data product."""

from __future__ import annotations

from pathlib import Path

from ground.errors import NotFoundError
from ground.gdr import values as v
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.get_resource import find_row
from ground.services.kinds import KINDS
from ground.services.views import show_products


def read_product(repo: Repository, actor: Actor, product_id: str) -> tuple[v.Product, Path]:
    """Return a product and where its file lies."""
    with repo.database.read() as session:
        row = find_row(session, KINDS["product"], product_id)
        actor.require(Action.READ, row.mission_id)
        product: v.Product = show_products(session, [row])[0]
    path = repo.files.path(product.sha256)
    if not path.is_file():
        raise NotFoundError(
            f"the file of product {product_id} is not in the store; `outcrop check` lists such products"
        )
    return product, path
