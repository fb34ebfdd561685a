"""What openapi-python-client makes of the service's page, used as a stranger would: JSON, a file, a batch and a job."""

import json
import sys
import time
from pathlib import Path

from generated import AuthenticatedClient
from generated.api.jobs import ask, fields, job, mesh
from generated.api.match import match
from generated.api.shapes import batch, info, shape
from generated.models import BatchRequest, JobRequestDehydration, Problem, ShapeFormat
from generated.types import File

address, token = sys.argv[1:]
client = AuthenticatedClient(base_url=address, token=token, raise_on_unexpected_status=True, timeout=120)
query = {"te": 0.03, "gamma": 7.0, "s": 0.25, "resolution": "16"}

said = info.sync("dehydration", client=client, **query)
file = shape.sync("dehydration", client=client, format_=ShapeFormat.GLB, **query)
points = [{"te": 0.03, "gamma": 7, "s": 0.1}]
wanted = BatchRequest.from_dict({"solver": "dehydration", "points": points, "format": "npz", "resolution": 16})
archive = batch.sync(client=client, body=wanted)
need = {"stages": [0.05], "quality": "preview", "fields": ["volume"]}
request = {"solver": "dehydration", "preset": "sphere", "params": {"te": 0.04}, "need": need}
asked = ask.sync(client=client, body=JobRequestDehydration.from_dict(request))
while asked.state in ("wanted", "running"):
    time.sleep(0.2)
    asked = job.sync(asked.id, client=client)
numbers = fields.sync(asked.id, client=client)
tetrahedron = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
sent = mesh.sync(client=client, body=File(payload=tetrahedron))
nearest = match.sync(client=client, body=File(payload=file.payload.read()), known="te:0.03,gamma:7")
file.payload.seek(0)
refused = info.sync("dehydration", client=client, **{**query, "te": 9.0})
assert isinstance(refused, Problem)
Path("shape.glb").write_bytes(file.payload.read())
Path("batch.npz").write_bytes(archive.payload.read())
print(
    json.dumps(
        {
            "value": said.stage.value,
            "state": str(asked.state),
            "dims": numbers.fields["volume"].dims,
            "refused": refused.title,
            "borders": sent.borders,
            "matched": nearest.best.solver,
        }
    )
)
