"""The document of a capture's channels in short."""

from grabberd.core.channels.account import Account
from grabberd.documents.channels import ChannelsSummary


def channels_summary(account: Account | None, *, sealed: bool) -> ChannelsSummary | None:
    """Verdict on the channels of a capture; None if it has none."""
    if account is None:
        return None
    names = [one.name for one in account.channels]
    if sealed:
        return ChannelsSummary.model_validate(
            {"names": names, "verdict": account.verdict, "in_words": account.in_words}
        )
    return ChannelsSummary(names=names, verdict=None, in_words="being recorded")
