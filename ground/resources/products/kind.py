"""How data products are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.products.row import ProductRow
from ground.resources.products.value import Product

PRODUCT = Kind(
    "product",
    "prd",
    "products",
    ProductRow,
    Product,
    Action.UPLINK,
    "data product",
    computed={
        "orphan": lambda row: row.request_id is None,
        "file_url": lambda row: f"/api/v1/products/{row.id}/file",
    },
)
