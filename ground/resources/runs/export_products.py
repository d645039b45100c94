"""Give out the data products of a run as one archive."""

from __future__ import annotations

import json
import zipfile
from dataclasses import asdict
from pathlib import Path

from sqlalchemy import select

from ground.gdr.archives import name_in_archive
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row
from ground.resources.products.kind import PRODUCT
from ground.resources.products.row import ProductRow
from ground.resources.runs.kind import RUN

FORMAT = "products/1"
STORED = ("id", "task_id", "request_id", "target_id", "kind", "instrument", "media", "size_bytes", "sha256")


def export_products(repo: Repository, actor: Actor, run_id: str, target: Path) -> None:
    """Write a zip: `manifest.json`, and each product as `ID/FILE`.

    The manifest names the run and, for each file, its SHA-256 and the task, request and target it is of.
    """
    with repo.database.read() as session:
        row = find_row(session, RUN, run_id)
        actor.require(Action.READ, row.mission_id)
        run = RUN.show_one(session, row)
        query = select(ProductRow).where(ProductRow.run_id == run_id).order_by(ProductRow.id)
        products = PRODUCT.show(session, list(session.scalars(query)))
    names = {p.id: f"{p.id}/{name_in_archive(p.file_name)}" for p in products}
    files = [
        {
            "path": names[p.id],
            "t_s": p.t_s,
            "label": p.label,
            **{name: value for name, value in asdict(p).items() if name in STORED},
        }
        for p in products
    ]
    manifest = {
        "format": FORMAT,
        "run": run.id,
        "plan": run.plan_id,
        "mission": run.mission_id,
        "crl_sha256": run.crl_sha256,
        "files": files,
    }
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("manifest.json", json.dumps(manifest, indent=1, sort_keys=True))
        for product in products:
            archive.write(repo.files.path(product.sha256), names[product.id])
