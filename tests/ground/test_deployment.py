"""What `docker compose up` starts: TLS in front, the service's key in one process alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from ground.cluster import Cluster
from ground.settings import load_settings

ROOT = Path(__file__).parents[2]
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
SERVICES = COMPOSE["services"]


def test_only_the_proxy_is_reached_from_outside_and_it_speaks_tls() -> None:
    assert {name for name, service in SERVICES.items() if "ports" in service} == {"proxy"}
    assert "443:443" in SERVICES["proxy"]["ports"]
    rules = (ROOT / "deploy" / "Caddyfile").read_text()
    assert "respond /metrics 404" in rules
    assert "reverse_proxy api:8000" in rules
    assert "http://" not in rules, "no plain site beside the one with a certificate"


def test_the_one_proxy_that_is_trusted_is_ours() -> None:
    environment = SERVICES["api"]["environment"]
    trusted = environment["OUTCROP_TRUSTED_PROXIES"]
    assert trusted == SERVICES["proxy"]["networks"]["edge"]["ipv4_address"]
    assert load_settings(trusted_proxies=trusted, auth=environment["OUTCROP_AUTH"]).trusted_proxies == trusted
    assert environment["OUTCROP_COOKIE_SECURE"] == "true"
    assert environment["OUTCROP_PUBLIC_HOSTS"] == SERVICES["proxy"]["environment"]["OUTCROP_SITE"]


def test_the_key_is_mounted_by_the_signer_alone() -> None:
    holders = {
        name
        for name, service in SERVICES.items()
        if any(v.startswith("keys:") for v in service.get("volumes", ()))
    }
    assert holders == {"signer"}
    assert "ports" not in SERVICES["signer"]
    assert "audit-head/1" in SERVICES["signer"]["command"]
    assert not {"package/2", "trust/1"} & set(SERVICES["signer"]["command"])


def started(*profiles: str) -> set[str]:
    """Return the services that these profiles start, as the compose specification says."""
    return {
        name for name, s in SERVICES.items() if not s.get("profiles") or set(profiles) & set(s["profiles"])
    }


def test_each_profile_starts_what_it_is_for_and_needs_nothing_that_it_does_not_start() -> None:
    usual = {"migrate", "api", "worker", "signer", "proxy"}
    assert started() == usual
    assert started("postgres") == usual | {"db"}
    assert started("cluster") == usual | {"scheduler", "dask-worker"}
    for profiles in ((), ("postgres",), ("cluster",), ("postgres", "cluster")):
        there = started(*profiles)
        for name in there:
            wanted = SERVICES[name].get("depends_on", {})
            needed = {other for other, how in wanted.items() if how.get("required", True)}
            assert needed <= there, f"{name} needs {needed - there} with {profiles}"


def test_the_schema_is_brought_up_in_a_step_of_its_own_before_servers_and_workers() -> None:
    assert SERVICES["migrate"]["command"] == ["outcrop", "migrate"]
    assert SERVICES["migrate"]["restart"] == "no"
    for name in ("api", "worker"):
        how = SERVICES[name]["depends_on"]["migrate"]
        assert how == {"condition": "service_completed_successfully"}


def test_the_cluster_speaks_tls_on_every_line_and_its_workers_have_no_database() -> None:
    worker = SERVICES["worker"]["environment"]
    files = [worker[f"OUTCROP_DASK_{part}"] for part in ("CA", "CERTIFICATE", "KEY")]
    secure = ["--tls-ca-file", files[0], "--tls-cert", files[1], "--tls-key", files[2]]
    for name in ("scheduler", "dask-worker"):
        command = SERVICES[name]["command"]
        assert command[-6:] == secure
        assert command[command.index("--protocol") + 1] == "tls"
        assert "ports" not in SERVICES[name]
        assert "OUTCROP_DATABASE_URL" not in SERVICES[name]["environment"]
        assert "./deploy/tls:/tls:ro" in SERVICES[name]["volumes"]
    assert SERVICES["dask-worker"]["command"][2] == worker["OUTCROP_DASK_SCHEDULER"] == "tls://scheduler:8786"
    assert Cluster(worker["OUTCROP_DASK_SCHEDULER"], *files[1:], files[0]).refusal().endswith("no such file")
    products = next(v for v in SERVICES["worker"]["volumes"] if v.startswith("products:"))
    assert products in SERVICES["dask-worker"]["volumes"]


def test_the_image_has_what_the_profiles_need_and_no_key() -> None:
    locked = (ROOT / "requirements" / "run.lock").read_text()
    assert all(f"\n{name}==" in locked for name in ("distributed", "psycopg", "s3fs"))
    for ignored in (".dockerignore", ".gitignore"):
        assert any(line.rstrip("/") == "deploy/tls" for line in (ROOT / ignored).read_text().splitlines())
