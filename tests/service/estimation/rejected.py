"""What engines say about samples that they did not use."""

from dropanchor_service.estimation.columns import PoseBatch


def rejected_rows(batch: PoseBatch) -> dict[str, list[int]]:
    """Return, by reason, the row of each sample that was not used."""
    return {reason: rows.tolist() for reason, rows in batch.rejected.items()}
