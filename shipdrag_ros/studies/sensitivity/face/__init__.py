# SPDX-License-Identifier: Apache-2.0
"""The verb `sensitivity`, and the page it writes."""
