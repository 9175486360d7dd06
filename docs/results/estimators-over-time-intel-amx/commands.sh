#!/bin/sh
# The commands of the other processor, without SupeRANSAC.
set -e
. ../estimators-over-time/commands.sh
