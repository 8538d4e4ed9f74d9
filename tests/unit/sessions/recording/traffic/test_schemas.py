"""Every topic of a recording stands in the documentation, with its schema."""

from __future__ import annotations

import pytest

from sessions.recording.traffic import schemas
from tests.support.repository import REPOSITORY

TABLE = [
    line
    for line in (REPOSITORY / "docs" / "sessions.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("| `/")
]
BY_FINGER = {
    "/ft/FINGER/wrench": schemas.schema_by_form(schemas.wrench_topic("FF")),
    "/biotac/FINGER/readings": schemas.schema_by_form(schemas.biotac_topic("FF")),
}


@pytest.mark.parametrize(("topic", "schema"), [*schemas.SCHEMAS.items(), *BY_FINGER.items()])
def test_a_topic_is_listed_with_its_schema(topic, schema):
    rows = [line for line in TABLE if f"`{topic}`" in line.split("|")[1]]
    assert len(rows) == 1
    assert f"`{schema.name}`" in rows[0]
