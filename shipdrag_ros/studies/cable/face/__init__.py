# SPDX-License-Identifier: Apache-2.0
"""The verb `cable`, and the page it writes."""
