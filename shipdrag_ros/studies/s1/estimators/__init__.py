# SPDX-License-Identifier: Apache-2.0
"""The problems of S1 as estimators: every module in this folder is one."""
