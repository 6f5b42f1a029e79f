"""An S3-compatible server on loopback that counts what it is asked for: moto's."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import boto3
import pytest
from moto.server import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import make_server

BUCKET = "drives"
_ANYBODY = "AWS4-HMAC-SHA256 Credential=somebody/20261122/us-east-1/s3/aws4_request"


@dataclass
class Server:
    """Its address, and the (object, bytes) of each range that was fetched."""

    url: str = ""
    ranges: list[tuple[str, int]] = field(default_factory=list)

    @property
    def client(self) -> Any:
        """Amazon's own client of it."""
        return boto3.client("s3", endpoint_url=self.url)

    def put(self, file: Path, key: str) -> str:
        """Store a file of this machine, and return its address."""
        self.client.upload_file(str(file), BUCKET, key)
        return f"s3://{BUCKET}/{key}"

    def fetched(self) -> int:
        """Return how many bytes were fetched."""
        return sum(length for _, length in self.ranges)


@contextmanager
def s3_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    """Serve one empty bucket, which the environment gives access to."""
    server = Server()
    moto = DomainDispatcherApplication(create_backend_app)

    def counting(environ: dict[str, Any], start_response: Any) -> Any:
        if environ["REQUEST_METHOD"] == "GET" and (asked := environ.get("HTTP_RANGE")):
            first, last = asked.removeprefix("bytes=").split("-")
            server.ranges.append((environ["PATH_INFO"], int(last) - int(first) + 1))
        # Google's client has no password here, and moto wants Amazon's kind of signature.
        if environ.get("HTTP_AUTHORIZATION", "Bearer").startswith("Bearer"):
            environ["HTTP_AUTHORIZATION"] = _ANYBODY
        return moto(environ, start_response)

    served = make_server("127.0.0.1", 0, counting, threaded=True)
    thread = threading.Thread(target=served.serve_forever, daemon=True)
    thread.start()
    server.url = f"http://127.0.0.1:{served.server_port}"
    for name, value in {
        "AWS_ACCESS_KEY_ID": "somebody",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_REGION": "us-east-1",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": server.url,
    }.items():
        monkeypatch.setenv(name, value)
    server.client.create_bucket(Bucket=BUCKET)
    try:
        yield server
    finally:
        served.shutdown()
        thread.join()
