"""`outcrop serve`, `outcrop worker`, `outcrop migrate`."""

from __future__ import annotations

import typer

from ground.cli.failure import fail

KEEP_ALIVE_S = 150
"""Longer than clients keep an idle connection (httpx 5 s, nginx 60 s, Caddy 120 s): a request that meets
the server's closing of it gets no answer, and what is not idempotent is not sent again by itself.
"""


def _trace() -> None:
    """Trace if the environment says where to."""
    from ground import tracing
    from ground.errors import UnavailableError

    try:
        tracing.set_up()
    except UnavailableError as err:
        fail(err.message)


def register(app: typer.Typer) -> None:
    @app.command("serve")
    def serve(
        host: str | None = typer.Option(None, help="address to listen on; default OUTCROP_HOST or 127.0.0.1"),
        port: int | None = typer.Option(None, min=0, max=65535, help="port; default OUTCROP_PORT or 8000"),
        worker: bool = typer.Option(True, "--worker/--no-worker", help="also do the jobs"),
    ) -> None:
        """Serve the API and the UI, and do the jobs; an empty database is made ready. Is the server."""
        import os
        import socket

        if host is not None:
            os.environ["OUTCROP_HOST"] = host
        if port is not None:
            os.environ["OUTCROP_PORT"] = str(port)
        if not worker:
            os.environ["OUTCROP_SERVE_WORKER"] = "false"
        from ground.cli.repository import settings_or_fail
        from ground.spare_memory import keep_together

        keep_together()
        settings = settings_or_fail()
        listener = socket.socket(socket.AF_INET6 if ":" in settings.host else socket.AF_INET)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((settings.host, settings.port))
            # Who follows the printed address at once waits for the answer and is not turned away.
            listener.listen(2048)
        except OSError as err:
            listener.close()
            fail(
                f"cannot listen on {settings.host} port {settings.port}: {err.strerror}; choose "
                "another --port"
            )
        from ground.cli.repository import make_if_empty, require_migrated

        make_if_empty(settings)
        require_migrated(settings)
        _trace()
        import uvicorn

        from ground.app.calm_server import CalmServer

        shown = settings.host if settings.host not in {"0.0.0.0", "::"} else socket.gethostname()
        typer.echo(f"Outcrop is at http://{shown}:{listener.getsockname()[1]}/  (stop with Ctrl-C)")
        config = uvicorn.Config(
            "ground.app.service:create_app",
            factory=True,
            log_config=None,
            access_log=False,
            timeout_graceful_shutdown=5,
            timeout_keep_alive=KEEP_ALIVE_S,
            server_header=False,
            proxy_headers=bool(settings.trusted_proxies),
            forwarded_allow_ips=settings.trusted_proxies or None,
        )
        CalmServer(config).run(sockets=[listener])

    @app.command("worker")
    def worker_command(
        once: bool = typer.Option(False, "--once", help="end when no job waits"),
    ) -> None:
        """Do jobs for a server elsewhere on the same database. Needs no server."""
        import signal

        from ground.app.courier import Courier
        from ground.app.job_kinds import job_kinds
        from ground.cli.repository import open_or_fail
        from ground.jobs.worker import Worker
        from ground.logs import set_up_logging
        from ground.spare_memory import keep_together

        keep_together()
        repo = open_or_fail()
        set_up_logging(repo.settings.log_format, repo.settings.log_level)
        _trace()
        hands = Worker(repo, job_kinds())
        if once:
            count = hands.run_until_idle()
            typer.echo(f"{count} job{'' if count == 1 else 's'} done")
            return
        courier = Courier(repo)
        courier.start()
        signal.signal(signal.SIGTERM, lambda *_: hands.stop())
        typer.echo(
            f"worker {hands.name} looks for jobs in {repo.database.url.render_as_string(hide_password=True)}"
        )
        try:
            hands.run()
        except KeyboardInterrupt:
            hands.stop()
        finally:
            courier.stop()

    @app.command("migrate")
    def migrate_command() -> None:
        """Bring the database to the schema of this version. Needs no server."""
        from ground.cli.repository import settings_or_fail
        from ground.gdr.migrate import migrate
        from ground.gdr.repository import open_repository
        from ground.resources.people.accounts import ensure_profiles

        repo = open_repository(settings_or_fail())
        before, after = migrate(repo.database)
        ensure_profiles(repo)
        where = repo.database.url.render_as_string(hide_password=True)
        word = "is up to date" if before == after else f"migrated from {before or 'nothing'}"
        typer.echo(f"{where} {word} (revision {after})")
