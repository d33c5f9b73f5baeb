# SPDX-License-Identifier: Apache-2.0
"""The page on the bridge: what a node says, or what a bag holds, for a browser."""
