# Completion of dotyk and its commands for bash: the options that --help lists, the files that a command reads.
_dotyk() {
  local cur prev words cword split files=nml
  _init_completion -s || return
  case $1 in
    *dotyk-convert) files=inp ;;
    *dotyk-render | *dotyk-summary) files=vtkhdf ;;
  esac
  case $prev in
    --help)
      ! $split || COMPREPLY=($(compgen -W 'markdown man' -- "$cur"))
      return
      ;;
    --threads | --partition) return ;;
    --output | -o) files= ;;
    --restart) files=vtkhdf ;;
  esac
  if [[ $cur == -* ]]; then
    COMPREPLY=($(compgen -W '$("$1" --help | sed -nE "s/^ +(-[[:alpha:]] ?[^ ,]*, )?(--[[:alpha:]-]+).*/\2/p")' -- "$cur"))
  else
    _filedir "$files"
  fi
} && complete -F _dotyk dotyk dotyk-render dotyk-summary dotyk-convert
