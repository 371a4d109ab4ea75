# Completion of dotyk and its commands for bash: options are those that --help lists, files those that a command reads.
_dotyk() {
  local cur prev words cword files=nml
  _init_completion -s || return
  case $1 in
    *dotyk-convert) files=inp ;;
    *dotyk-render | *dotyk-summary) files=vtkhdf ;;
  esac
  case $prev in
    --help) COMPREPLY=($(compgen -W 'markdown man' -- "$cur")) && return ;;
    --threads | --partition) return ;;
    --output | -o) _filedir && return ;;
    --restart) files=vtkhdf ;;
  esac
  if [[ $cur == -* ]]; then
    COMPREPLY=($(compgen -W '$(_parse_help "$1")' -- "$cur"))
  else
    _filedir "$files"
  fi
} && complete -F _dotyk dotyk dotyk-render dotyk-summary dotyk-convert
