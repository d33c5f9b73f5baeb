# SPDX-License-Identifier: Apache-2.0
"""The one builder of pages, and how pictures look; what they tell stands with each result."""
