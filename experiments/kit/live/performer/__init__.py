# SPDX-License-Identifier: Apache-2.0
"""A service that calls a function of an experiment on the live robot; `config.Config` names the function."""
