#include "tools/isowave/help_groups.hpp"

#include <stdexcept>

namespace isowave::core::tools {

void group_options(CLI::App &command, const std::string &title,
                   std::initializer_list<const char *> names) {
  for (const char *name : names) {
    CLI::Option *option = command.get_option_no_throw(name);
    if (option == nullptr) throw std::logic_error(std::string("there is no option ") + name);
    option->group(title);
  }
}

void group_volume_options(CLI::App &command) {
  group_options(command, "What a file does not say, or says wrongly",
                {"--dims", "--type", "--spacing", "--index", "--no-data"});
}

void group_compression_options(CLI::App &command) {
  group_options(command, "Compression of a volume that is not compressed yet",
                {"--rate", "--tolerance", "--tolerance-relative", "--exact", "--levels"});
}

}  // namespace isowave::core::tools
