"""Problem of a job that failed."""

from grabberd.documents.document import Document


class JobProblem(Document):
    """Message and hint of what has failed."""

    message: str
    hint: str
