# SPDX-License-Identifier: Apache-2.0
"""The one builder of pages, and how pictures look; what they show stands with each result."""
