# SPDX-License-Identifier: Apache-2.0
"""The verb `surface`, and the page it writes."""
