# SPDX-License-Identifier: Apache-2.0
"""The verb `residual`, and the page it writes."""
