from .claim import Claim, Effort, Finding, Row, Tell
from .claim_runs import ClaimRun, claims_digest, run_claims, run_document, write_aside
from .planted_errors import plant
from .results_page import drifted, read_record, record_results, recorded_page, to_text
from .row_table import conclude, conclude_with_figure, row_line

__all__ = [
    "Claim",
    "ClaimRun",
    "Effort",
    "Finding",
    "Row",
    "Tell",
    "claims_digest",
    "conclude",
    "conclude_with_figure",
    "drifted",
    "plant",
    "read_record",
    "record_results",
    "recorded_page",
    "row_line",
    "run_claims",
    "run_document",
    "to_text",
    "write_aside",
]
