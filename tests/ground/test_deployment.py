"""What `docker compose up` starts: TLS in front, the service's key in one process alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

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
