# SPDX-License-Identifier: Apache-2.0
"""Times as machines write them."""

from __future__ import annotations

import re
from datetime import datetime, tzinfo

from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.sources.log import LIMIT_NS

_ISO = re.compile(
    r'(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)(?:[.,](\d{1,12}))?\s*(Z|[+-]\d\d:?\d\d)?'
)


def iso_ns(text: str, zone: tzinfo) -> int | None:
    """
    Return the time of ISO 8601 [ns since 1970], exactly; None where it is none.

    Parameters
    ----------
    text
    zone
        Of a time that states none.
    """
    found = _ISO.fullmatch(text)
    if found is None:
        return None
    try:
        moment = datetime.fromisoformat(f'{found[1]}T{found[2]}{found[4] or ""}')
        if moment.tzinfo is None:
            moment = moment.replace(tzinfo=zone)
        seconds = int(moment.timestamp())
    except (ValueError, OverflowError):
        return None
    time_ns = seconds * SECOND_NS + int((found[3] or '')[:9].ljust(9, '0'))
    return time_ns if 0 <= time_ns < LIMIT_NS else None
