"""Settings of the ground system, read from the environment and checked at start."""

from __future__ import annotations

import os
import re
from enum import StrEnum
from importlib.util import find_spec
from ipaddress import ip_network
from pathlib import Path
from typing import Literal

from pydantic import Field, SecretStr, ValidationError, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from ground.cluster import Cluster

MARK = "!"
"""Between the parts of an address of a file or folder (`ground.gdr.store`)."""


class SettingsError(Exception):
    """A setting cannot be used; the message names the variable, its value and what is allowed."""


class Authentication(StrEnum):
    """How people are told apart."""

    PROFILES = "profiles"
    ACCOUNTS = "accounts"


class ExecutorKind(StrEnum):
    """Where the work of a job is done."""

    PROCESS = "process"
    INLINE = "inline"
    DISTRIBUTED = "distributed"


def default_data_dir() -> Path:
    """Return `$XDG_DATA_HOME/outcrop`, or `./var` in a checkout that already has one."""
    local = Path("var")
    if local.is_dir():
        return local.resolve()
    base = os.environ.get("XDG_DATA_HOME") or str(Path.home() / ".local" / "share")
    return Path(base) / "outcrop"


class Settings(BaseSettings):
    """Everything an operator can set; each field is the variable `OUTCROP_<NAME>`."""

    model_config = SettingsConfigDict(env_prefix="OUTCROP_", extra="ignore", frozen=True)

    data_dir: Path = Field(default_factory=default_data_dir)
    """Folder of the embedded database, terrains, products and runs."""
    profiles: Path | None = None
    """Folder of rover profiles of one's own, found by name beside those of the program."""
    objects: str = ""
    """URL of an object store (`s3://bucket/folder`) that keeps files and folders; empty = the data folder."""
    database_url: str = ""
    """SQLAlchemy address; empty = SQLite file `outcrop.db` in the data folder."""
    auth: Authentication = Authentication.PROFILES
    """`profiles`: named people without passwords, loopback only. `accounts`: passwords and API keys."""
    host: str = "127.0.0.1"
    port: int = Field(default=8000, ge=0, le=65535)
    public_hosts: str = ""
    """Comma-separated host names that browsers may use beside loopback and `host`."""
    executor: ExecutorKind = ExecutorKind.PROCESS
    dask_scheduler: str = ""
    """Address of a Dask scheduler; needed by `executor=distributed`."""
    dask_certificate: str = ""
    dask_key: str = ""
    dask_ca: str = ""
    """PEM files for TLS with the cluster: our certificate, its key, the authority that signed both sides'."""
    serve_worker: bool = True
    """Whether `outcrop serve` also does jobs; false where `outcrop worker` runs beside it."""
    workers: int = Field(default=2, ge=1, le=256)
    """Jobs that one worker carries out at the same time."""
    warm_up: bool = True
    """Whether the planner is got ready in the background when the server starts."""
    job_lease_s: float = Field(default=15.0, gt=0.1, le=3600.0)
    job_time_limit_s: float = Field(default=1800.0, gt=0.1, le=86400.0)
    job_attempts: int = Field(default=3, ge=1, le=100)
    approval_runs: int = Field(default=0, ge=0, le=1_000_000)
    """Runs of a campaign that an approval needs (flight rule FR-CAMPAIGN); 0 asks for none."""
    spice_kernels: str = ""
    """Comma-separated SPICE kernels (LSK, SPK, PCK); they tell the sun of sols with a start in UTC."""
    max_body_mib: float = Field(default=256.0, gt=0.0, le=65536.0)
    session_hours: float = Field(default=12.0, gt=0.0, le=720.0)
    trusted_proxies: str = ""
    """Comma-separated addresses or networks (10.0.0.0/24) of proxies whose X-Forwarded-For is believed; never
    `*`: guesses count by address.
    """
    cookie_secure: bool = False
    """Send session cookies over https only."""
    public_url: str = ""
    """Address of the service as browsers see it, such as `https://ops.example`; needed with a provider."""
    oidc_issuer: str = ""
    """Issuer of an OpenID Connect provider by which people may log in beside passwords."""
    oidc_client_id: str = ""
    oidc_client_secret: SecretStr = SecretStr("")
    oidc_role: Literal["none", "viewer", "scientist", "planner", "flight_director", "operator"] = "none"
    """What somebody may who comes by the provider for the first time."""
    webhook_hosts: str = ""
    """Comma-separated hosts (`hooks.example`, `hooks.example:8443`) that webhooks may lead to."""
    log_level: str = "info"
    log_format: str = "text"
    """`text` or `json`."""
    stream_seconds: float = Field(default=15.0, gt=0.05, le=300.0)
    """A comment is sent on a silent event stream this often, so that proxies keep it open."""

    @field_validator("profiles")
    @classmethod
    def _a_folder(cls, folder: Path | None) -> Path | None:
        if folder is not None and not folder.is_dir():
            raise ValueError("there is no such folder of rover profiles")
        return folder

    @field_validator("spice_kernels")
    @classmethod
    def _files(cls, given: str) -> str:
        for part in filter(None, (p.strip() for p in given.split(","))):
            if not Path(part).is_file():
                raise ValueError(f"there is no kernel {part!r}")
        return given

    @field_validator("database_url")
    @classmethod
    def _known_database(cls, url: str) -> str:
        if url.startswith("postgres://"):
            url = "postgresql://" + url.removeprefix("postgres://")
        if url.startswith("postgresql://"):
            url = "postgresql+psycopg://" + url.removeprefix("postgresql://")
        if url and not url.startswith(("sqlite:", "postgresql+psycopg:")):
            raise ValueError("use sqlite:///FILE or postgresql://USER:PASSWORD@HOST/NAME")
        return url

    @field_validator("objects")
    @classmethod
    def _known_store(cls, url: str) -> str:
        if not url:
            return url
        scheme, mark, place = url.partition("://")
        if not mark or not place.strip("/") or MARK in url:
            raise ValueError("use SCHEME://BUCKET/FOLDER, such as s3://rovers/outcrop")
        return f"{scheme}://{place.strip('/')}"

    @field_validator("trusted_proxies")
    @classmethod
    def _named_proxies(cls, given: str) -> str:
        for part in filter(None, (p.strip() for p in given.split(","))):
            try:
                network = ip_network(part)
            except ValueError:
                raise ValueError(
                    f"{part!r} is neither an address nor a network; with * anybody could write the address "
                    "they come from and so guess passwords without limit: name your proxies"
                ) from None
            if network.prefixlen == 0:
                raise ValueError(f"{part!r} is everybody; name the addresses or networks of your proxies")
        return given

    @field_validator("webhook_hosts")
    @classmethod
    def _hosts(cls, given: str) -> str:
        for part in filter(None, (p.strip() for p in given.split(","))):
            if not re.fullmatch(r"[A-Za-z0-9.-]+(:[0-9]{1,5})?", part):
                raise ValueError(
                    f"{part!r} is not a host: give its name, as hooks.example or hooks.example:8443"
                )
        return given.lower()

    @field_validator("log_level")
    @classmethod
    def _known_level(cls, level: str) -> str:
        if level.lower() not in {"debug", "info", "warning", "error"}:
            raise ValueError("use debug, info, warning or error")
        return level.lower()

    @field_validator("log_format")
    @classmethod
    def _known_format(cls, form: str) -> str:
        if form not in {"text", "json"}:
            raise ValueError("use text or json")
        return form

    @property
    def database_address(self) -> str:
        """Return the SQLAlchemy address, the embedded database when none is set."""
        return self.database_url or f"sqlite:///{self.data_dir / 'outcrop.db'}"

    @property
    def cluster(self) -> Cluster:
        """Return how the Dask cluster is reached."""
        return Cluster(self.dask_scheduler, self.dask_certificate, self.dask_key, self.dask_ca)

    @property
    def kernels(self) -> tuple[Path, ...]:
        """Return the SPICE kernels in the order in which they are loaded."""
        return tuple(Path(part.strip()) for part in self.spice_kernels.split(",") if part.strip())

    @property
    def hook_hosts(self) -> frozenset[str]:
        """Return the hosts that webhooks may lead to, with a port where it is not that of https."""
        return frozenset(part.strip().removesuffix(":443") for part in self.webhook_hosts.split(",")) - {""}

    @property
    def is_loopback(self) -> bool:
        return self.host in {"127.0.0.1", "::1", "localhost"}


def load_settings(**given: object) -> Settings:
    """Return the settings of this process.

    Raises
    ------
    SettingsError
        If one cannot be used: the message names each wrong variable, its value and the rule.
    """
    try:
        settings = Settings(**given)  # type: ignore[arg-type]
    except ValidationError as err:
        wrong = []
        for problem in err.errors():
            name = f"OUTCROP_{'_'.join(str(p) for p in problem['loc']).upper()}"
            wrong.append(f"{name}={problem.get('input')!r}: {problem['msg'].removeprefix('Value error, ')}")
        raise SettingsError("; ".join(wrong)) from err
    if settings.executor is ExecutorKind.DISTRIBUTED and not settings.dask_scheduler:
        raise SettingsError(
            "OUTCROP_DASK_SCHEDULER='': the distributed executor needs the scheduler's address"
        )
    if settings.executor is ExecutorKind.DISTRIBUTED and find_spec("distributed") is None:
        raise SettingsError(
            "OUTCROP_EXECUTOR='distributed': the package distributed is not installed (extra `cluster`)"
        )
    if settings.executor is ExecutorKind.DISTRIBUTED and (refusal := settings.cluster.refusal()):
        raise SettingsError(refusal)
    if settings.objects:
        if MARK in str(settings.data_dir):
            raise SettingsError(
                f"OUTCROP_DATA_DIR={str(settings.data_dir)!r}: with OUTCROP_OBJECTS, without {MARK!r}"
            )
        _check_objects(settings.objects)
    if settings.oidc_issuer:
        _check_provider(settings)
    if settings.auth is Authentication.PROFILES and not settings.is_loopback:
        raise SettingsError(
            f"OUTCROP_HOST={settings.host!r}: profiles without passwords are for loopback only; set "
            "OUTCROP_AUTH=accounts"
        )
    return settings


def _check_objects(url: str) -> None:
    scheme = url.partition("://")[0]
    if find_spec("fsspec") is None or (scheme == "s3" and find_spec("s3fs") is None):
        raise SettingsError(f"OUTCROP_OBJECTS={url!r}: the package s3fs is not installed (extra `objects`)")
    from fsspec import available_protocols, get_filesystem_class

    if scheme not in available_protocols():
        raise SettingsError(f"OUTCROP_OBJECTS={url!r}: the file system {scheme!r} is unknown to fsspec")
    try:
        get_filesystem_class(scheme)
    except ImportError as err:
        raise SettingsError(f"OUTCROP_OBJECTS={url!r}: {err}") from err


def _check_provider(settings: Settings) -> None:
    if settings.auth is not Authentication.ACCOUNTS:
        raise SettingsError("OUTCROP_OIDC_ISSUER: a provider is for accounts; set OUTCROP_AUTH=accounts")
    for name, value in (("CLIENT_ID", settings.oidc_client_id), ("ISSUER", settings.oidc_issuer)):
        if not value:
            raise SettingsError(f"OUTCROP_OIDC_{name}='': the provider's is needed")
    for name, address in (("OIDC_ISSUER", settings.oidc_issuer), ("PUBLIC_URL", settings.public_url)):
        local = address.startswith(("http://localhost", "http://127.0.0.1"))
        if not address.startswith("https://") and not local:
            raise SettingsError(f"OUTCROP_{name}={address!r}: give an address with https://")
    if find_spec("authlib") is None:
        raise SettingsError("OUTCROP_OIDC_ISSUER: the package authlib is not installed (extra `oidc`)")
