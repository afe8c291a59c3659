#!/bin/bash
# Runs as a unit in a throw-away Debian that systemd-nspawn has booted (boot-test.sh).
set -euo pipefail
step() { printf -- '-- %s\n' "$*"; }
fail() { printf 'boot-checks.sh: %s\n' "$*"; exit 1; }
single=/run/sonard/sonard.sock
front=/run/sonard/front/sonard.sock
rear=/run/sonard/rear/sonard.sock

# Waits until a command succeeds: within SECONDS COMMAND...
within() {
  local limit=$1 until
  shift
  until=$((SECONDS + limit))
  until "$@" >/dev/null 2>&1; do
    [ "$SECONDS" -lt "$until" ] || fail "not within $limit s: $*"
    sleep 0.2
  done
}

# get SOCKET ROUTE: what the API answers.
get() { curl --silent --show-error --max-time 10 --unix-socket "$1" "http://localhost/v1/$2"; }
healthy() { [[ $(get "$1" health) == *'"healthy":true'* ]]; }
unhealthy() { [[ $(get "$1" health) == *'"healthy":false'* ]]; }
step_is() { [[ $(get "$1" plan) == *"\"step_deg\":$2,"* ]]; }
property() { systemctl show --value --property="$2" "$1"; }
active() { systemctl --quiet is-active "$1"; }
status_text_is() { [ "$(property "$1" StatusText)" = "$2" ]; }
restarts_are() { [ "$(property "$1" NRestarts)" = "$2" ] && active "$1"; }
# start UNIT...: done once all are ready.
start() { timeout 60 systemctl start "$@" || fail "not ready within a minute: $*"; }
said_since() { journalctl --unit="$1" --since="$2" --output=cat --no-pager; }

# Everybody who should be reached is, by whom it should be.
reached() {
  local socket
  for socket in "$@"; do
    within 20 healthy "$socket"
    runuser -u member -- curl --silent --fail --unix-socket "$socket" http://localhost/v1/health >/dev/null ||
      fail "a member of the group sonard does not reach $socket: $(ls -ld "${socket%/*}" "$socket")"
    if runuser -u stranger -- curl --silent --unix-socket "$socket" http://localhost/v1/health >/dev/null; then
      fail "a stranger reaches $socket: $(ls -ld "${socket%/*}" "$socket")"
    fi
  done
}

prepare() {
  step "a ranger of its own for each daemon"
  if [ -e /root/sonard.deb ]; then
    dpkg --install /root/sonard.deb >/root/dpkg 2>&1 || fail "$(cat /root/dpkg)"
  fi
  systemctl --quiet is-active sonard.service && fail "installing has started the daemon"
  useradd --groups sonard member
  useradd stranger
  cat >/etc/systemd/system/ranger@.service <<'UNIT'
[Service]
User=sonard
RuntimeDirectory=ranger
RuntimeDirectoryPreserve=yes
ExecStart=/usr/bin/sonard mock --realtime --scene simple-room --pose fig9 --link /run/ranger/%i
UNIT
  # What takes a minute on a robot is to take seconds here.
  local unit
  for unit in sonard.service sonard@.service; do
    mkdir -p "/etc/systemd/system/$unit.d"
    printf '[Service]\nTimeoutStartSec=8\nWatchdogSec=6\n' >"/etc/systemd/system/$unit.d/test.conf"
  done
  cp /etc/sonard/sonard.toml /root/shipped.toml
  configure sonard single
  configure front front
  configure rear rear
  systemctl daemon-reload
}

# configure NAME RANGER: the shipped configuration with a port and a scene.
configure() {
  sed -e "s|^# port = .*|port = \"/run/ranger/$2\"|" -e 's|^# scene = .*|scene = "simple-room"|' \
    -e 's|^pose = .*|pose = "fig9"|' /root/shipped.toml >/root/edited
  install --group=sonard --mode=640 /root/edited "/etc/sonard/$1.toml"
}

check_start() {
  step "not ready before the ranger has identified itself, however long that takes"
  start sonard.socket
  systemctl start --no-block sonard.service
  # Longer than TimeoutStartSec.
  sleep 14
  [ "$(property sonard.service ActiveState)" = activating ] || fail "$(systemctl status --no-pager sonard.service)"
  [ "$(property sonard.service NRestarts)" = 0 ] || fail "it was not given its start-up time"
  unhealthy "$single" || fail "well without a ranger: $(get "$single" health)"
  [ -n "$(property sonard.service StatusText)" ] || fail "no status text"
  start ranger@single.service
  within 20 active sonard.service
  within 5 status_text_is sonard.service ready
  reached "$single"
}

check_reload() {
  step "reload"
  step_is "$single" 0.9 || fail "$(get "$single" plan)"
  sed -i 's/^step_deg = .*/step_deg = 1.8/' /etc/sonard/sonard.toml
  systemctl reload sonard.service
  within 5 step_is "$single" 1.8
  local since pid
  pid=$(property sonard.service MainPID)
  since=$(date '+%F %T')
  sed -i 's/^step_deg = .*/step_deg = "wide"/' /etc/sonard/sonard.toml
  systemctl reload sonard.service
  within 5 wrong_file_is_told "$since"
  step_is "$single" 1.8 || fail "a wrong file has changed the plan: $(get "$single" plan)"
  sed -i 's/^step_deg = .*/step_deg = 2.7/' /etc/sonard/sonard.toml
  systemctl reload sonard.service
  within 5 step_is "$single" 2.7
  [ "$pid" = "$(property sonard.service MainPID)" ] || fail "a reload has restarted the daemon"
  reached "$single"
}

wrong_file_is_told() { said_since sonard.service "$1" | grep -F sonard.toml | grep -qF step_deg; }

check_restart() {
  step "restart, kill"
  timeout 60 systemctl restart sonard.service
  active sonard.service || fail "not ready after a restart"
  reached "$single"
  systemctl kill --kill-whom=main --signal=KILL sonard.service
  within 30 restarts_are sonard.service 1
  reached "$single"
}

check_watchdog() {
  step "watchdog, fed and not"
  # Three times the watchdog's limit, idle and scanning.
  curl --silent --fail --unix-socket "$single" --json '{"scans": 1}' http://localhost/v1/start >/dev/null ||
    fail "no scan could be started"
  sleep 18
  restarts_are sonard.service 1 || fail "$(systemctl status --no-pager sonard.service)"
  local since
  since=$(date '+%F %T')
  systemctl kill --kill-whom=main --signal=STOP sonard.service
  within 60 restarts_are sonard.service 2
  said_since sonard.service "$since" | grep -q 'Watchdog timeout' || fail "$(said_since sonard.service "$since")"
  reached "$single"
}

check_instances() {
  step "instances beside it"
  start ranger@front.service ranger@rear.service
  start sonard@front.service sonard@rear.service
  reached "$single" "$front" "$rear"
  timeout 60 systemctl restart sonard@front.service
  reached "$single" "$front" "$rear"
  systemctl kill --kill-whom=main --signal=KILL sonard@front.service
  within 30 restarts_are sonard@front.service 1
  reached "$single" "$front" "$rear"
  systemctl kill --kill-whom=main --signal=STOP sonard@front.service
  within 60 restarts_are sonard@front.service 2
  reached "$single" "$front" "$rear"
  systemctl stop sonard@rear.service
  reached "$single" "$front"
  [ ! -e "$rear" ] || fail "a stopped instance leaves its socket"
  start sonard@rear.service
  reached "$single" "$front" "$rear"
}

check_stop() {
  step "stopping one leaves the others"
  systemctl stop sonard.service
  reached "$front" "$rear"
  # The socket waits for clients and starts the daemon.
  [ -S "$single" ] || fail "stopping the daemon removed its socket, which is the socket unit's"
  reached "$single"
  active sonard.service || fail "the daemon answers and is not active"
  systemctl stop sonard.socket sonard.service
  [ ! -e "$single" ] || fail "stopping the socket unit leaves the socket"
  reached "$front" "$rear"
  start sonard.service
  reached "$single" "$front" "$rear"
}

check_folders() {
  step "folders, files and warnings of systemd"
  local log
  for log in /var/lib/sonard /var/lib/sonard/front /var/lib/sonard/rear; do
    ls "$log"/*.jsonl >/dev/null || fail "no log in $log"
  done
  [ "$(stat -c '%a %U %G' /etc/sonard)" = '750 root sonard' ] || fail "$(ls -ld /etc/sonard)"
  [ "$(stat -c '%a %U %G' /run/sonard)" = '750 sonard sonard' ] || fail "$(ls -ld /run/sonard)"
  # Of the folders and settings of these units systemd has nothing to remark.
  local lines
  lines=$(journalctl --no-pager --output=cat _PID=1 | grep -F sonard | grep -iE 'mode is different|unknown|ignoring|deprecated|not supported' || true)
  [ -z "$lines" ] || fail "$lines"
  lines=$(journalctl --no-pager --output=cat --unit='sonard*' | grep -iE 'mode is different|permission denied|panicked' || true)
  [ -z "$lines" ] || fail "$lines"
}

# A log folder outside of /var/lib/sonard: the rejection names the drop-in, with which it works.
check_log_folder() {
  step "a log folder elsewhere, by a drop-in"
  local folder=/srv/sonar-logs since drop_in=/etc/systemd/system/sonard@away.service.d
  install -d -o sonard -g sonard "$folder"
  configure away away
  sed -i "s|^# folder = .*|folder = \"$folder\"|" /etc/sonard/away.toml
  start ranger@away.service
  since=$(date '+%F %T')
  systemctl start --no-block sonard@away.service
  within 20 drop_in_is_suggested "$since" "$folder"
  systemctl stop sonard@away.service
  mkdir -p "$drop_in"
  printf '[Service]\nReadWritePaths=%s\n' "$folder" >"$drop_in/log.conf"
  systemctl daemon-reload
  systemctl reset-failed sonard@away.service 2>/dev/null || true
  start sonard@away.service
  within 20 healthy /run/sonard/away/sonard.sock
  ls "$folder"/*.jsonl >/dev/null || fail "no log in $folder"
  systemctl stop sonard@away.service
}

drop_in_is_suggested() {
  local text
  text=$(journalctl --unit=sonard@away.service --since="$1" --output=cat --no-pager)
  [[ $text == *"systemctl edit sonard@away.service"* && $text == *"ReadWritePaths=$2"* ]]
}

# Device nodes without hardware: what the policy allows has no device, anything else is forbidden.
check_devices() {
  step "device policy"
  mknod --mode=660 /dev/ttyS63 c 4 127 && mknod --mode=660 /dev/other c 10 229 ||
    { step "device policy: LEFT OUT, because no device node can be made here"; return 0; }
  chgrp dialout /dev/ttyS63 /dev/other
  if systemd-run --quiet --wait --property=DevicePolicy=strict dd if=/dev/urandom of=/dev/null count=1 2>/dev/null; then
    step "device policy: LEFT OUT, because the control groups here do not enforce it"
    return 0
  fi
  configure serial serial
  sed -i 's|^port = .*|port = "/dev/ttyS63"|' /etc/sonard/serial.toml
  configure other other
  sed -i 's|^port = .*|port = "/dev/other"|' /etc/sonard/other.toml
  systemctl start --no-block sonard@serial.service sonard@other.service
  within 20 link_is serial "no hardware"
  within 20 link_is other "device policy"
  mkdir -p /etc/systemd/system/sonard@other.service.d
  printf '[Service]\nDeviceAllow=/dev/other rw\n' >/etc/systemd/system/sonard@other.service.d/device.conf
  systemctl daemon-reload
  systemctl restart --no-block sonard@other.service
  within 20 link_is_not other "device policy"
  systemctl stop sonard@serial.service sonard@other.service
}

link_is() { [[ $(get "/run/sonard/$1/sonard.sock" status) == *"$2"* ]]; }
link_is_not() { local text; text=$(get "/run/sonard/$1/sonard.sock" status) && [[ $text != *"$2"* ]]; }

check_package() {
  step "upgrade while all run"
  dpkg --install --force-confdef --force-confold /root/later.deb >/root/dpkg 2>&1 || fail "$(cat /root/dpkg)"
  within 30 active sonard.service
  reached "$single" "$front" "$rear"
  step "remove"
  dpkg --remove sonard >/root/dpkg 2>&1 || fail "$(cat /root/dpkg)"
  active sonard.service && fail "a removed daemon runs"
  [ ! -e "$single" ] || fail "removing leaves the socket"
}

prepare
check_start
check_reload
check_restart
check_watchdog
check_instances
check_stop
check_folders
check_log_folder
check_devices
if [ -e /root/later.deb ]; then check_package; fi
printf 'all checks passed\n'
