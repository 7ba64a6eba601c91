"""A capture through the generated client, in the client's own environment: `python capture.py URL TOKEN`."""

import json
import sys
import time

from grabberd_client import AuthenticatedClient
from grabberd_client.api.captures import (
    delete_capture,
    get_capture,
    get_field_png,
    get_points,
    get_points_csv,
    start_capture,
)
from grabberd_client.models import CaptureDocument, Labels, NewCapture

PATIENCE_S = 30.0


def sealed(client: AuthenticatedClient, capture_id: str) -> CaptureDocument:
    """Once it is."""
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        document = get_capture.sync(capture_id, client=client)
        if document.state == "sealed":
            return document
        time.sleep(0.02)
    raise TimeoutError(capture_id)


def main(url: str, token: str) -> None:
    """Prints what was seen."""
    client = AuthenticatedClient(url, token, raise_on_unexpected_status=True)
    new = NewCapture(fields=20, bits=1, labels=Labels.from_dict({"cow": "112"}))
    ids = [start_capture.sync(client=client, body=new, idempotency_key="one").id for _ in range(2)]
    document = sealed(client, ids[0])
    points = get_points.sync(ids[0], client=client, every=3)
    text = get_points_csv.sync(ids[0], client=client)
    picture = get_field_png.sync(ids[0], 0, client=client)
    deleted = delete_capture.sync_detailed(ids[0], client=client)
    gone = get_capture.sync(ids[0], client=client)
    seen = {
        "ids": ids,
        "labels": document.labels.to_dict(),
        "complete": document.ledger.complete,
        "received": document.ledger.counts["received"],
        "numbers": [field.n for field in points.fields],
        "targets": len(points.fields[0].target),
        "lines": len(text.splitlines()),
        "picture": picture.payload.read(4).hex(),
        "deleted": deleted.status_code,
        "hint": gone.hint,
    }
    print(json.dumps(seen))


if __name__ == "__main__":
    main(*sys.argv[1:])
