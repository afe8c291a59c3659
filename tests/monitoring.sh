#!/usr/bin/env bash
# Has promtool, of Debian's package prometheus, judge the alert rules and the configuration, and try the rules.
set -euo pipefail
cd "$(dirname "$0")/../config/monitoring"
promtool check rules sonard-alerts.yml
promtool check config --syntax-only prometheus.yml
promtool test rules sonard-alerts.test.yml
