"""Give out the file of a data product."""

from __future__ import annotations

from pathlib import Path

from ground.errors import NotFoundError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row
from ground.resources.products.kind import PRODUCT
from ground.resources.products.value import Product


def read_product(repo: Repository, actor: Actor, product_id: str) -> tuple[Product, Path]:
    """Return a product and where its file lies."""
    with repo.database.read() as session:
        row = find_row(session, PRODUCT, product_id)
        actor.require(Action.READ, row.mission_id)
        product = PRODUCT.show_one(session, row)
    path = repo.files.path(product.sha256)
    if not path.is_file():
        raise NotFoundError(
            f"the file of product {product_id} is not in the store; `outcrop check` lists such products"
        )
    return product, path
