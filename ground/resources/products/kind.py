"""How data products are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.products.row import ProductRow
from ground.resources.products.value import Product


def show_products(_session: object, rows: Sequence[ProductRow]) -> list[Product]:
    return [
        value_of(Product, r, orphan=r.request_id is None, file_url=f"/api/v1/products/{r.id}/file")
        for r in rows
    ]


PRODUCT = Kind("product", "data product", "prd", "products", ProductRow, show_products, Action.UPLINK)
