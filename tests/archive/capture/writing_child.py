"""Writes a capture as the recorder does, until it is killed; tells what it has appended."""

import time

from archive.captures import MADE_WITH, META, ledger_of, meta, points, slot
from archive.readings import CHANNELS, readings
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.channels.account import Account, ChannelAccount, ChannelLedger

FIELDS_A_SECOND = 50
FASTER = 10
READINGS_A_FIELD = 4


def write_fields(part, count, tell):
    writer = CaptureWriter.create(part, meta(bits=8), channels=CHANNELS[:1])
    ledger = ChannelLedger(ChannelAccount("pulsation", "tank"))
    writer.begin_run(1, "live", META.created_utc, "0.1.0", MADE_WITH)
    writer.keep_account(Account((ledger.account,)))
    writer.commit()
    prepared = [slot(n, bits=8) for n in range(10)]
    started, n = time.monotonic(), 0
    while n < count:
        time.sleep(max(0.0, started + n / (FIELDS_A_SECOND * FASTER) - time.monotonic()))
        model = prepared[n % 10]
        writer.append([model._replace(n=n, numbered=model.numbered._replace(n=n))])
        writer.append_points(1, n, points(n))
        part_of_channel = readings(n * READINGS_A_FIELD, READINGS_A_FIELD)
        writer.append_readings(0, part_of_channel)
        ledger.enter(part_of_channel.time_ns)
        tell.send(n)
        n += 1
        if n % (FIELDS_A_SECOND // 2) == 0:
            writer.keep_account(Account((ledger.account,)))
            writer.commit()
    taken = (slot(0)._replace(n=n) for n in range(count))
    writer.seal(ledger_of(taken), complete=True, ended_because="length reached")
