"""Give out the file of a data product."""

from __future__ import annotations

from pathlib import Path

from ground.errors import NotFoundError
from ground.gdr.files import FarFile
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row
from ground.resources.products.kind import PRODUCT
from ground.resources.products.value import Product


def read_product(
    repo: Repository, actor: Actor, product_id: str, *, in_parts: bool = False
) -> tuple[Product, Path | FarFile]:
    """Return a product and where its file lies; `in_parts` takes one that would have to be brought first."""
    with repo.database.read() as session:
        row = find_row(session, PRODUCT, product_id)
        actor.require(Action.READ, row.mission_id)
        product = PRODUCT.show_one(session, row)
    if in_parts and (far := repo.files.far(product.sha256)) is not None:
        return product, far
    path = repo.files.path(product.sha256)
    if not path.is_file():
        raise NotFoundError(
            f"the file of product {product_id} is not in the store; `outcrop check` lists such products"
        )
    return product, path
