# SPDX-License-Identifier: Apache-2.0
"""`python -m mobee_system VERB` is the command `mobee VERB`, for programs that start it with their own Python."""

from mobee_system import main

if __name__ == "__main__":
    raise SystemExit(main())
