# SPDX-License-Identifier: GPL-3.0-or-later
"""The one exception whose text is meant for the user."""


class CloudError(Exception):
    """One sentence or two: what is wrong, by name, and what to do about it."""
