"""The version of the contract: a receiver refuses every other one."""

VERSION = 3
