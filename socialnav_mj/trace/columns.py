"""What a trace says, column by column, so that two files can be compared: their bytes always differ."""

from pathlib import Path

from rerun.chunk import RrdReader

from socialnav_mj.episode import EpisodeError

_ROW_ID = "rerun.controls.RowId"


def trace_columns(path: str | Path) -> dict[str, str]:
    """Everything that a trace shows, without what the clock puts into it.

    Args:
        path: Of `write_trace`.

    Returns:
        Values in the order in which they were logged, as text, by "entity column".

    Raises:
        EpisodeError: If the file is damaged or no rerun recording.
    """
    parts = []
    try:
        for chunk in RrdReader(path).stream().to_chunks():
            batch = chunk.to_record_batch()
            entity = batch.schema.metadata[b"rerun:entity_path"].decode()
            # Row ids count up, so they order the chunks of one entity as they were logged.
            parts.append((batch.column(_ROW_ID)[0].as_py(), entity, batch.drop_columns([_ROW_ID])))
    except (RuntimeError, ValueError, TypeError, IndexError, KeyError) as error:
        raise EpisodeError(f"{path} is not a readable trace: {error}") from error
    columns: dict[str, list[object]] = {}
    for _, entity, batch in sorted(parts, key=lambda part: part[0]):
        for name in batch.schema.names:
            columns.setdefault(f"{entity} {name}", []).extend(batch.column(name).to_pylist())
    return {name: repr(values) for name, values in columns.items()}


def differing_columns(stored: str | Path, again: str | Path) -> tuple[str, ...]:
    """Columns of two traces that do not say the same.

    Args:
        stored: One file.
        again: The other one.

    Returns:
        Their names, in alphabetical order.

    Raises:
        EpisodeError: If a file is damaged.
    """
    one, two = trace_columns(stored), trace_columns(again)
    return tuple(sorted(name for name in one.keys() | two.keys() if one.get(name) != two.get(name)))
