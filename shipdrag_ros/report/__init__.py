# SPDX-License-Identifier: Apache-2.0
"""What was found, told to a reader: sentences, tables, pictures, one page."""
