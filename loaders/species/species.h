// Species: from file names, to the five families of the SMAL shape space, and which animals are no
// quadrupeds.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "manifests/sample.h"

namespace q3d::loaders::species {

// Lower case, single spaces; '+' and '_' are spaces ("german+shepherd").
std::string normalised_species(std::string_view name);

// Sub-dataset names are spelled freely ("AwA-Pose", "stanforddogs", "AP_10K"): lower case, letters and digits
// only.
std::string normalised_source(std::string_view name);

// The species that a picture's name or its sub-dataset tells, or "":
// - `<species>_<number>_<number>.jpg` (AwA-Pose) where the species is one that the family table knows;
// - `n<8 digits>_<number>` (ImageNet): the synset's animal; a dog for all breeds of StanfordDogs;
// - `<12 digits>_<class>` (COCO pictures of Animal3D);
// - sub-datasets of one animal (horse-10, cheetah, stanforddogs, iRodents), compared without case, '-' and
// '_';
// - AnimalPose's ca, co, do, ho, sh and a number.
std::string species_of_picture(std::string_view file_name, std::string_view source_dataset);

// The family of a species; Family::none for animals outside the five, nothing for a name that the table
// lacks. "polar bear" is found by its last word; names that this would mislead ("prairie dog") stand in the
// table.
//
// The table is zoological: Felidae, Canidae, Equidae, Bovidae and Hippopotamidae as in Wilson & Reeder's
// Mammal Species of the World (3rd edition, 2005), which are SMAL's five shape families. AniMer's author
// counts sheep with the horses; PRIMA's paper and this table have them in Bovidae. A family that the
// annotation file states always wins.
std::optional<manifests::Family> family_of_species(std::string_view species);

// Animal Kingdom's mammal split holds birds, primates, kangaroos and others that a quadruped's body cannot
// show.
struct AnimalClass {
  std::string parent_class;  // "Mammal"
  std::string animal_class;
  std::string subclass;  // "Dog / Wolf / Fox / Coyote / Jackal"
  std::string animal;    // "Wolf"
};

// The rule that leaves an animal out, or "": a class other than mammals, or a listed word that is, or ends,
// the animal's name or one of its subclass's.
std::string not_a_quadruped(const AnimalClass& animal);

// By the animal's name; where the table lacks it, by its subclass if all names there agree.
std::optional<manifests::Family> family_of(const AnimalClass& animal);

}  // namespace q3d::loaders::species
